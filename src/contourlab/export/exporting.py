"""From a scenario, or a law with its machine and reference, to files for real time."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
import tempfile
from pathlib import Path
from typing import Any

from contourlab.controllers.base import Controller
from contourlab.errors import ConfigurationError, ExportError, choices
from contourlab.export.c_target import write_c
from contourlab.export.compiled import FLAGS, compile_c, find_compiler
from contourlab.export.folder import new_folder, refuse_folder
from contourlab.export.generate import GeneratedC, check_prefix, generate
from contourlab.export.golden import RecordedLoop, record_loop
from contourlab.export.parity import Parity, check_parity
from contourlab.export.scalar_types import Precision
from contourlab.export.stack import STACK_FLAG, says_stack
from contourlab.feedrate import Plan
from contourlab.machines import Machine
from contourlab.recordings.reference import Reference
from contourlab.simulation.checks import as_reference, snake_case

__all__ = ["GOLDEN_STEPS", "TARGETS", "ExportResult", "export"]

GOLDEN_STEPS = 2000
"""Steps of the loop that are kept as golden data, at the most."""

TARGETS: dict[str, str] = {
    "c": "",
    "linuxcnc": "contourlab.export.linuxcnc_target",
    "fmu": "contourlab.export.fmu",
}
"""Targets, and the module that writes each beside plain C. Its function ``write`` takes what
:func:`write_c` takes, and options of its own; ``refuse`` says before what is wrong with them."""


@dataclasses.dataclass(frozen=True)
class ExportResult:
    """What was written.

    Parameters
    ----------
    target
        Of the export.
    output
        Its folder or file.
    files
        Names of the files in it.
    generated
        The law as C.
    parity
        What a replay of the golden data gave here; None where there was no compiler.
    """

    target: str
    output: Path
    files: tuple[str, ...]
    generated: GeneratedC
    parity: Parity | None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is not as it should be, in sentences."""
        if self.parity is None:
            return ("no C compiler was found: the exported code was not compiled or compared",)
        found = []
        if self.parity.relative > self.parity.bound.relative:
            found.append(
                f"the exported law differs from JAX by {self.parity.relative:.3g} of the peak "
                f"command, more than {self.parity.bound.relative:.3g}"
            )
        found += [
            f"{one.name} of the exported law differs from JAX by {one.relative:.3g} of its peak, "
            f"more than {one.bound.relative:.3g}"
            for one in self.parity.telemetry
            if not one.holds
        ]
        for step, name, wanted, got in self.parity.flipped[:5]:
            found.append(f"step {step}: {name} is {got} in C, {wanted} in JAX")
        if len(self.parity.flipped) > 5:
            found.append(f"and {len(self.parity.flipped) - 5} more decisions came out otherwise")
        return tuple(found)


def export(
    what: Any,
    *,
    output: str | Path,
    controller: str | None = None,
    machine: Machine | str | None = None,
    reference: Reference | Plan | None = None,
    target: str = "c",
    precision: str = "double",
    prefix: str | None = None,
    force: bool = False,
    steps: int = GOLDEN_STEPS,
    **options: Any,
) -> ExportResult:
    """Write a control law for real time: C99, or what is made of it.

    Parameters
    ----------
    what
        A scenario, as ``contourlab.scenarios.read_scenario`` returns it, or a controller.
    output
        Folder, new or empty; the target says if it is a file.
    controller
        Which controller of the scenario; may be left out if there is one.
    machine
        Which machine of the scenario, by name; with a controller, the machine whose loop is
        recorded as golden data.
    reference
        With a controller: what the loop follows.
    target
        ``"c"``, or one of ``TARGETS``.
    precision
        Of reals: ``"double"`` or ``"single"``.
    prefix
        Of every external name; from the controller's name if not given.
    force
        Whether an export that is there may be replaced.
    steps
        Of the loop that are kept as golden data, at the most.
    **options
        Of the target.

    Raises
    ------
    ExportError
        The law uses what cannot be exported; names it and the line of the law.
    OutputError
        The folder is not empty and not an export, or one that may not be replaced.
    ConfigurationError
        A target, precision, prefix or controller that there is not.
    """
    if target not in TARGETS:
        raise ConfigurationError(f"unknown target {target!r}; {choices(target, TARGETS)}")
    Precision(precision)
    name, law, stage, motion, extra = _chosen(what, controller, machine, reference)
    prefix = check_prefix(prefix) if prefix is not None else identifier(name)
    output = Path(output)
    if not TARGETS[target]:
        if options:
            raise ConfigurationError(
                f"target {target} has no option {sorted(options)[0]!r}; it has none"
            )
        refuse_folder(output, force=force)
    else:
        _refuse_options(target, options)
        importlib.import_module(TARGETS[target]).refuse(output, force=force, **options)
    loop = record_loop(stage, law, motion, steps=steps, **extra)
    generated = generate(
        loop.law, loop.first(), sample_time=loop.sample_time, prefix=prefix, precision=precision,
        command=loop.controller.needs.command,
    )  # fmt: skip
    parity = measured_parity(generated, loop)
    if TARGETS[target]:
        write = importlib.import_module(TARGETS[target]).write
        files = write(generated, loop, output, parity, force=force, **options)
    else:
        with new_folder(output, force=force) as folder:
            files = write_c(generated, loop, folder, parity)
    return ExportResult(target, output, tuple(files), generated, parity)


def _refuse_options(target: str, options: dict[str, Any]) -> None:
    known = inspect.signature(importlib.import_module(TARGETS[target]).refuse).parameters
    if any(one.kind is inspect.Parameter.VAR_KEYWORD for one in known.values()):
        return  # the target says itself
    for name in options:
        if name not in known or name in ("output", "force"):
            raise ConfigurationError(
                f"target {target} has no option {name!r}; "
                f"{choices(name, sorted(set(known) - {'output', 'force'}))}"
            )


def measured_parity(generated: GeneratedC, loop: RecordedLoop) -> Parity | None:
    """Return how the compiled law compares with JAX over a loop; None without a compiler.

    Parameters
    ----------
    generated
        The law.
    loop
        Recorded with it.
    """
    compiler = find_compiler()
    if compiler is None:
        return None
    flags = (*FLAGS, STACK_FLAG) if says_stack(compiler) else FLAGS
    with tempfile.TemporaryDirectory() as folder:
        return check_parity(generated, compile_c(generated, folder, flags=flags), loop)


def identifier(name: str) -> str:
    """Return a name of a controller as a prefix in C.

    Parameters
    ----------
    name
        As the user wrote it.
    """
    text = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_").lower()
    if not text or not text[0].isalpha():
        text = f"controller_{text}".rstrip("_")
    return check_prefix(text[:41].rstrip("_"))


def _chosen(
    what: Any, controller: str | None, machine: Machine | str | None,
    reference: Reference | Plan | None,
) -> tuple[str, Controller, Machine, Reference, dict[str, Any]]:  # fmt: skip
    """Return name, law, machine and reference, and what else the loop takes."""
    if isinstance(what, Controller):
        if not isinstance(machine, Machine) or reference is None:
            raise ExportError(
                "a controller is exported with machine= and reference=: a loop of it is recorded "
                "as golden data"
            )
        name = controller or snake_case(type(what).__name__)
        return name, what, machine, as_reference(reference), {}
    setups = getattr(what, "setups", None)
    if setups is None:
        raise ExportError(
            "export takes a scenario, as contourlab.scenarios.read_scenario returns it, or a "
            f"controller, got {type(what).__name__}"
        )
    if isinstance(machine, Machine) or reference is not None:
        raise ExportError("machine= and reference= go with a controller, not with a scenario")
    where = _one(setups, machine, "machine")
    setup = setups[where]
    name = _one({**setup.controllers, **setup.refused}, controller, "controller")
    if name in setup.refused:
        raise setup.refused[name]
    extra = {"disturbances": what.disturbances, "seed": what.seed}
    return name, setup.controllers[name], setup.machine, setup.reference, extra


def _one(table: Any, name: str | None, kind: str) -> str:
    if name is None:
        if len(table) == 1:
            return str(next(iter(table)))
        raise ConfigurationError(f"the scenario has several {kind}s; {choices('', table)}")
    if name in table:
        return name
    # hyphens, underscores and spaces count alike, as they do for types
    alike = [one for one in table if identifier(one) == identifier(name)]
    if len(alike) == 1:
        return str(alike[0])
    raise ConfigurationError(f"unknown {kind} {name!r}; {choices(name, table)}")
