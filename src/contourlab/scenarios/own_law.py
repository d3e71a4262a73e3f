"""A law from a user's own file, named in a scenario as ``type = "my_law.py:MyLaw"``.

The file is Python and is run: a scenario that names one is trusted as a program is.
"""

from __future__ import annotations

import importlib.util
import inspect
import sys
import traceback
from pathlib import Path
from typing import Any

from contourlab.configuration import snake_case
from contourlab.controllers.base import Controller
from contourlab.errors import ConfigurationError, ContourlabError, choices

__all__ = ["is_own_law", "law_name", "load_own_law"]


def is_own_law(name: object) -> bool:
    """Return whether a type names a class in a file.

    Parameters
    ----------
    name
        As written.
    """
    return isinstance(name, str) and ".py" in name


def law_name(type_: str) -> str:
    """Return what a controller is called that has no name: its type, or its class's name.

    Parameters
    ----------
    type_
        As written.
    """
    if not is_own_law(type_):
        return type_.replace("-", "_")
    file, _, wanted = type_.partition(":")
    return snake_case(wanted or Path(file).stem)


def load_own_law(name: str, folder: Path) -> type:
    """Return the class of a law in a file.

    Parameters
    ----------
    name
        File and class, ``"my_law.py:MyLaw"``; without the class, the only law that the file has.
    folder
        Where the file is looked for.

    Raises
    ------
    ConfigurationError
        There is no such file or class, the file fails, or the class is no law.
    """
    text, _, wanted = name.partition(":")
    if not text.endswith(".py"):
        raise ConfigurationError(f'must be "file.py:Class", got {name!r}')
    path = (folder / text).absolute()
    if not path.is_file():
        raise ConfigurationError(f"no file {text!r}: it is looked for beside the scenario")
    module = _module(path, text)
    laws = {
        key: value
        for key, value in vars(module).items()
        if inspect.isclass(value) and issubclass(value, Controller)
        and not inspect.isabstract(value) and value.__module__ == module.__name__
    }  # fmt: skip
    if not wanted and len(laws) == 1:
        return next(iter(laws.values()))
    if wanted not in laws:
        if hasattr(module, wanted):
            raise ConfigurationError(f"{wanted!r} in {text} is not a control law (a Controller)")
        which = f"no class {wanted!r} in {text}" if wanted else f"{text} has several laws, or none"
        raise ConfigurationError(f"{which}; {choices(wanted, laws)}")
    return laws[wanted]


def _module(path: Path, text: str) -> Any:
    name = f"contourlab_law_{path.stem}_{abs(hash(str(path)))}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except ContourlabError:
        raise
    except Exception as error:
        del sys.modules[name]
        line = next(
            (f":{one.lineno}" for one in reversed(traceback.extract_tb(error.__traceback__))
             if one.filename == str(path)), "",
        )  # fmt: skip
        if isinstance(error, SyntaxError) and error.filename == str(path):
            line = f":{error.lineno}"
        raise ConfigurationError(f"{text}{line} fails: {type(error).__name__}: {error}") from error
    return module
