"""Target ``linuxcnc`` of ``export``: the component's files in a folder of their own."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from contourlab.errors import ConfigurationError, choices
from contourlab.export.c_target import write_manifest
from contourlab.export.folder import MANIFEST, new_folder, refuse_folder
from contourlab.export.generate import GeneratedC
from contourlab.export.golden import RecordedLoop
from contourlab.export.law_facts import LawFacts
from contourlab.export.linuxcnc import LinuxcncOptions, linuxcnc_files
from contourlab.export.parity import Parity

__all__ = ["refuse", "write"]


def refuse(output: Path, *, force: bool, **options: Any) -> None:
    """Raise if the files cannot be written there, or an option is not right.

    Parameters
    ----------
    output
        The folder.
    force
        Whether an export that is there may be replaced.
    **options
        Fields of :class:`~contourlab.export.linuxcnc.LinuxcncOptions`.

    Raises
    ------
    RefusedError
        No licence, or one that does not go with LinuxCNC's.
    ConfigurationError
        An option that there is not, or out of bounds.
    OutputError
        The folder is not empty and not an export, or one that may not be replaced.
    """
    known = [field.name for field in dataclasses.fields(LinuxcncOptions)]
    for name in options:
        if name not in known:
            raise ConfigurationError(
                f"target linuxcnc has no option {name!r}; {choices(name, known)}"
            )
    LinuxcncOptions(**options)
    refuse_folder(output, force=force)


def write(
    generated: GeneratedC, loop: RecordedLoop, output: Path, parity: Parity | None, *,
    force: bool, **options: Any,
) -> list[str]:  # fmt: skip
    """Write the files of target ``linuxcnc`` and return their names.

    Parameters
    ----------
    generated
        The law.
    loop
        In which it was recorded: knows the law's configuration.
    output
        The folder.
    parity
        What a replay of the loop showed.
    force
        Whether an export that is there may be replaced.
    **options
        As for :func:`refuse`.

    Raises
    ------
    RefusedError
        LinuxCNC cannot give what the law reads.
    """
    chosen = LinuxcncOptions(**options)
    facts = LawFacts.of(loop.controller, loop.law)
    files = linuxcnc_files(generated, facts, chosen)
    with new_folder(output, force=force) as folder:
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
        names = [*files, MANIFEST]
        said = {**dataclasses.asdict(chosen), "n_axes": facts.n_axes,
                "command": facts.needs.command}  # fmt: skip
        write_manifest(generated, folder, "linuxcnc", names, parity, linuxcnc=said)
    return names
