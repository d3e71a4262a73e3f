"""Machine files: a machine in TOML, to be named by scenarios, and any machine as such a file.

The content is that of ``[machine]`` of a scenario without the section's name: ``command``,
``[[axis]]`` and the rest, with ``title``, ``source`` and ``assumed`` to say where the numbers come
from. Every number is written with the digits that give it back exactly.
"""

from __future__ import annotations

import os
import tempfile
import tomllib
from pathlib import Path as FilePath

import pydantic

from contourlab.errors import OutputError, ScenarioError
from contourlab.machines import Machine
from contourlab.scenarios.locate import line_of
from contourlab.scenarios.machine import build_machine
from contourlab.scenarios.machine_schema import MachineSection
from contourlab.scenarios.machine_text import machine_to_toml
from contourlab.scenarios.refusal import dotted, refuse
from contourlab.scenarios.values import KeyedError

__all__ = ["machine_to_toml", "read_machine_file", "read_machine_text", "write_machine_file"]

LARGEST_FILE = 1 << 20


def read_machine_file(file: str | FilePath) -> Machine:
    """Return the machine of a TOML file.

    Parameters
    ----------
    file
        The machine file.

    Raises
    ------
    ScenarioError
        The file cannot be read, or something in it is wrong: file, line, key, value and choices.
    """
    path = FilePath(file)
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ScenarioError(f"larger than {LARGEST_FILE} bytes", file=str(file))
        data = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        why = getattr(error, "strerror", None) or str(error)
        raise ScenarioError(f"cannot be read ({why})", file=str(file)) from error
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ScenarioError("not a text in UTF-8", file=str(file), line=line) from error
    return read_machine_text(text, name=str(file))


def read_machine_text(text: str, *, name: str = "machine") -> Machine:
    """Return the machine of a TOML text.

    Parameters
    ----------
    text
        The machine file's text.
    name
        What to call it in messages.

    Raises
    ------
    ScenarioError
        As ``read_machine_file``.
    """
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"not valid TOML: {error}", file=name) from error
    except RecursionError:
        raise ScenarioError("not valid TOML: nested too deeply", file=name) from None
    if "file" in raw:
        raise ScenarioError(
            "a machine file does not name another", file=name, line=line_of(text, ("file",)),
            key="file",
        )  # fmt: skip
    try:
        return build_machine(MachineSection.model_validate(raw), None)
    except pydantic.ValidationError as error:
        refuse(error, MachineSection, text, name)
    except KeyedError as error:
        key = error.key[1:] if error.key[:1] == ("machine",) else error.key
        raise ScenarioError(
            error.message, file=name, line=line_of(text, key), key=dotted(key)
        ) from error


def write_machine_file(machine: Machine, file: str | FilePath, *, overwrite: bool = False) -> None:
    """Write a machine as a TOML file that gives it back.

    Parameters
    ----------
    machine
        Any machine of these parts: rigid, two-mass, ball-screw, transfer-function or state-space
        axes, and an identity or linear tool.
    file
        Where; written whole or not at all.
    overwrite
        Whether an existing file is replaced.

    Raises
    ------
    OutputError
        The file exists already, or cannot be written.
    ConfigurationError
        A batch of machines, or a part of a class that the format does not know.
    """
    path = FilePath(file)
    text = machine_to_toml(machine)
    if path.exists() and not overwrite:
        raise OutputError(f"{path} exists already; give overwrite=True to replace it")
    try:
        handle, draft = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as stream:
                stream.write(text)
            umask = os.umask(0)
            os.umask(umask)
            FilePath(draft).chmod(0o666 & ~umask)
            FilePath(draft).replace(path)
        except BaseException:
            FilePath(draft).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror})") from error
