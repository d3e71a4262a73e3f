"""Folders that belong to an export: marked by their manifest, written whole or not at all."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from contourlab.errors import OutputError

__all__ = ["MANIFEST", "SCHEMA", "new_folder", "refuse_folder"]

MANIFEST = "export.json"
SCHEMA = "contourlab.export-folder/1"


def refuse_folder(folder: Path, *, force: bool) -> None:
    """Raise OutputError unless a folder is new, empty, or an export that may be replaced.

    Parameters
    ----------
    folder
        Where an export will go.
    force
        Whether an export that is there may be replaced. A folder with anything else in it is
        refused in any case.
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise OutputError(f"{folder} is a file, not a folder")
    if not any(folder.iterdir()):
        return
    if not _is_export(folder):
        raise OutputError(
            f"{folder} is not empty and not an export of contourlab (no {MANIFEST} of ours in it): "
            "give a new folder, --force does not replace what is not ours"
        )
    if not force:
        raise OutputError(f"{folder} holds an export already; --force replaces it")


def _is_export(folder: Path) -> bool:
    try:
        found: Any = json.loads((folder / MANIFEST).read_text())
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and found.get("schema") == SCHEMA


@contextmanager
def new_folder(folder: Path, *, force: bool) -> Iterator[Path]:
    """Give a folder to write into; it takes its place when all went well, and is gone otherwise.

    Parameters
    ----------
    folder
        Where the export goes.
    force
        Whether an export that is there may be replaced.

    Raises
    ------
    OutputError
        The place cannot be used.
    """
    refuse_folder(folder, force=force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    except OSError as error:
        raise OutputError(f"{folder} cannot be made ({error.strerror})") from error
    try:
        yield work
        work.chmod(0o777 & ~_umask())
        # an export that is replaced goes only when the new one is whole
        old = folder.with_name(f"{work.name}-old") if folder.exists() else None
        if old is not None:
            folder.rename(old)
        work.rename(folder)
        if old is not None:
            shutil.rmtree(old)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written ({error.strerror})") from error
    finally:
        if work.exists():
            shutil.rmtree(work, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
