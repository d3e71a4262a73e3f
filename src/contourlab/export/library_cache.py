"""C text compiled into a library, kept in the user's cache folder by what it was made of.

A library's name is the digest of its source, its flags and the compiler that made it; it is written
beside and moved into place, so that programs that run at the same time do not see half of one.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import platform
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from contourlab.errors import ExportError, OutputError
from contourlab.export.compiled import find_compiler

__all__ = ["cache_folder", "compiled_library"]


def cache_folder() -> Path:
    """Return where compiled loops are kept: ``contourlab/c`` in the user's cache folder."""
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(home) / "contourlab" / "c"


def compiled_library(
    source: str, *, flags: Sequence[str], folder: Path | None = None
) -> ctypes.CDLL:
    """Return a library made of a source, compiled unless it was before.

    Parameters
    ----------
    source
        Of one file.
    flags
        Of the compiler.
    folder
        Where libraries are kept; that of :func:`cache_folder` if not given.

    Raises
    ------
    ExportError
        There is no compiler, or it refuses.
    OutputError
        The folder cannot be used.
    """
    compiler = find_compiler()
    if compiler is None:
        raise ExportError(
            "no C compiler was found: install gcc or clang, or name one in the environment's CC"
        )
    what = "\0".join((_version(compiler), platform.machine(), *flags, source))
    folder = cache_folder() if folder is None else Path(folder)
    library = folder / f"{hashlib.sha256(what.encode()).hexdigest()[:32]}.so"
    if library.exists():
        try:
            return ctypes.CDLL(str(library))
        except OSError:
            pass  # made elsewhere, or damaged: it is made anew
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as place:
            made = _compile(compiler, source, flags, Path(place))
            os.replace(made, library)
    except OSError as error:
        raise OutputError(
            f"compiled loops cannot be kept in {folder}: {error.strerror or error}; name another "
            "folder for caches in XDG_CACHE_HOME"
        ) from None
    return ctypes.CDLL(str(library))


def _compile(compiler: str, source: str, flags: Sequence[str], folder: Path) -> Path:
    text, made = folder / "loop.c", folder / "loop.so"
    text.write_text(source)
    command = [compiler, *flags, "-fPIC", "-shared", "-o", str(made), str(text), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ExportError(f"the C compiler refused the loop: {done.stderr.strip()}")
    return made


@functools.lru_cache(maxsize=8)
def _version(compiler: str) -> str:
    done = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False)
    return f"{compiler} {done.stdout}"
