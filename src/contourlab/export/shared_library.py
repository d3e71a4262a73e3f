"""Several C sources to one shared library, with the flags that every target's numbers rest on."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

from contourlab.errors import ExportError
from contourlab.export.compiled import FLAGS, find_compiler

__all__ = ["compile_library"]


def compile_library(sources: Sequence[Path], library: Path, *, flags: Sequence[str] = ()) -> Path:
    """Return a shared library made of C sources.

    Parameters
    ----------
    sources
        C files.
    library
        Where to put it.
    flags
        Further arguments for the compiler.

    Raises
    ------
    ExportError
        There is no compiler, or it refuses; holds its words.
    """
    compiler = find_compiler()
    if compiler is None:
        raise ExportError("no C compiler was found: install gcc or clang, or name one in CC")
    command = [compiler, *FLAGS, "-fPIC", "-shared", *flags, *map(str, sources)]
    run = subprocess.run(
        [*command, "-o", str(library), "-lm"], capture_output=True, text=True, check=False
    )
    if run.returncode != 0:
        raise ExportError(f"the C compiler refused what was exported:\n{run.stderr.strip()}")
    return library
