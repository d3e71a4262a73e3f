"""Files are written whole or not at all, and never over another without being told to."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path as FilePath

from contourlab.errors import OutputError

__all__ = ["atomic_file", "refuse_existing"]


def refuse_existing(file: str | FilePath, *, force: bool) -> None:
    """Raise OutputError if a file exists and may not be replaced.

    Parameters
    ----------
    file
        Where something is about to be written.
    force
        Whether it may be replaced.
    """
    if FilePath(file).exists() and not force:
        raise OutputError(
            f"{file} exists already; choose another name or pass --force (force=True)"
        )


@contextmanager
def atomic_file(file: str | FilePath, *, force: bool = False) -> Iterator[str]:
    """Give the name of a temporary file that takes the place of ``file`` when all went well.

    Parameters
    ----------
    file
        The name in the end; its folder is made if it is missing.
    force
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        The file exists already, or its folder cannot be written to.
    """
    target = FilePath(file)
    refuse_existing(target, force=force)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    except OSError as error:
        raise OutputError(f"{target}: cannot be written ({error.strerror})") from error
    os.close(handle)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
        os.replace(temporary, target)
    except BaseException:
        FilePath(temporary).unlink(missing_ok=True)
        raise
