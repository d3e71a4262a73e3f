"""Target ``linuxcnc``: an exported law as a HAL component, with what guards it.

The component is three layers of C. The law (``P.c``) is what every target ships. The servo layer
(``P_servo.c``) checks what comes in and what goes out, makes the path's geometry from the planner's
motion and knows nothing of HAL, so that it runs, is tested and replays logs anywhere. The component
(``P.comp``) copies pins.

A component is loaded into LinuxCNC, which is under the GPL: its licence has to be compatible and is
asked for, never assumed.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import contourlab
from contourlab.errors import ConfigurationError, RefusedError, choices
from contourlab.export.generate import GeneratedC
from contourlab.export.hal_items import gain_items, telemetry_items
from contourlab.export.law_facts import LawFacts
from contourlab.export.linuxcnc_inputs import law_inputs
from contourlab.export.stack import array_bytes
from contourlab.export.templating import render
from contourlab.simulation.result import COMMAND_UNITS

__all__ = ["LENGTH_UNITS", "LICENCES", "LinuxcncOptions", "linuxcnc_files", "template_values"]

LICENCES = {
    "GPL": "GNU General Public License",
    "GPL-2.0-only": "GNU General Public License, version 2",
    "GPL-2.0-or-later": "GNU General Public License, version 2 or later",
}
"""Licences that a component may state, by the line in its source."""

LENGTH_UNITS = {"mm": 1e-3, "inch": 0.0254, "m": 1.0}


@dataclasses.dataclass(frozen=True)
class LinuxcncOptions:
    """What the user says about the machine.

    Parameters
    ----------
    license
        The component's licence line, one of :data:`LICENCES`.
    joints
        LinuxCNC's joint for each axis of the law; 0, 1, ... if not given.
    length_unit
        LinuxCNC's ``[TRAJ] LINEAR_UNITS``: ``mm`` or ``inch`` (or ``m``).
    command_limit
        Limit of the command pins, per axis or one for all, in the unit of the law's command (SI);
        the law's own if not given.
    following_error_limit
        Distance between reference and feedback that trips the component [m].
    hold_speed
        Reference speed below which the path's direction stays as it was [m/s].
    minimum_radius
        Tighter curvature is cut to this radius [m].

    Raises
    ------
    RefusedError
        No licence, or one that does not go with LinuxCNC's.
    ConfigurationError
        A value out of bounds.
    """

    license: str | None = None
    joints: Sequence[int] | None = None
    length_unit: str = "mm"
    command_limit: float | Sequence[float] | None = None
    following_error_limit: float = 1e-3
    hold_speed: float = 1e-3
    minimum_radius: float = 1e-3

    def __post_init__(self) -> None:
        if self.license not in LICENCES:
            asked = "no license was given" if self.license is None else f"got {self.license!r}"
            raise RefusedError(
                "a component that is loaded into LinuxCNC must be under a licence compatible with "
                f"the GPL, and states it in its source: say --license (license=) with one of "
                f"{', '.join(LICENCES)}; {asked}. It binds whoever passes the component on"
            )
        if self.length_unit not in LENGTH_UNITS:
            raise ConfigurationError(
                f"unknown length_unit {self.length_unit!r}; "
                f"{choices(self.length_unit, LENGTH_UNITS)}"
            )
        for name, least in (
            ("following_error_limit", 0.0),
            ("hold_speed", 0.0),
            ("minimum_radius", 0.0),
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > least):
                raise ConfigurationError(f"{name} must be > {least:g}, got {value}")


def linuxcnc_files(
    generated: GeneratedC, facts: LawFacts, options: LinuxcncOptions
) -> dict[str, str]:
    """Return the files of a LinuxCNC component, by name.

    Parameters
    ----------
    generated
        The exported law.
    facts
        What it commands and asks for.
    options
        What the user says about the machine.

    Returns
    -------
    dict[str, str]
        The law's header and source, the servo layer, the component, a HAL file, a Makefile, and a
        README.

    Raises
    ------
    RefusedError
        LinuxCNC cannot give what the law reads; the law has no limit and none is given.
    ConfigurationError
        An option that does not fit the law, or a prefix that HAL cannot take.
    """
    values = template_values(generated, facts, options)
    prefix = generated.prefix
    return {
        f"{prefix}.h": generated.header,
        f"{prefix}.c": generated.source,
        f"{prefix}_servo.h": render("linuxcnc/servo.h.j2", values),
        f"{prefix}_servo.c": render("linuxcnc/servo.c.j2", values),
        f"{prefix}_component.h": render("linuxcnc/component.h.j2", values),
        f"{prefix}.comp": render("linuxcnc/component.comp.j2", values),
        f"{prefix}.hal": render("linuxcnc/machine.hal.j2", values),
        "Makefile": render("linuxcnc/Makefile.j2", values),
        "README.md": render("linuxcnc/README.md.j2", values),
    }


def template_values(
    generated: GeneratedC, facts: LawFacts, options: LinuxcncOptions
) -> Mapping[str, Any]:
    """Return what the templates are filled with.

    Parameters
    ----------
    generated, facts, options
        As for :func:`linuxcnc_files`.
    """
    prefix, n, kind = generated.prefix, facts.n_axes, facts.needs.command
    _refuse_prefix(prefix)
    joints = _joints(options, n)
    inputs = law_inputs(generated, facts)
    unit = options.length_unit
    scale = LENGTH_UNITS[unit]
    is_length = kind in ("velocity", "position")
    limits = _limits(facts, options, scale if is_length else 1.0)
    per_unit = {"velocity": f"{unit}/s", "position": unit}.get(kind, COMMAND_UNITS[kind])
    gains, hidden = gain_items(generated)
    return {
        "P": prefix,
        "hal": prefix.replace("_", "-"),
        "law": facts.name,
        "version": contourlab.__version__,
        "summary": f"{facts.name} on {n} axes, made by contourlab",
        "n": n,
        "joints": joints,
        "sample_time": _number(generated.sample_time),
        "period_ns": round(generated.sample_time * 1e9),
        "sample_time_ms": f"{generated.sample_time * 1e3:g}",
        "precision": generated.precision,
        "operations": generated.operations,
        "array_bytes": array_bytes(generated),
        "delay": inputs.delay,
        "delay_ms": f"{inputs.delay * generated.sample_time * 1e3:g}",
        "geometry": inputs.order >= 0,
        "order": inputs.order,
        "fill": inputs.lines,
        "unit": unit,
        "command_kind": kind,
        "command_unit": per_unit,
        "command_is_length": is_length,
        "scale": [_number(scale)] * n,
        "command_limit": [_number(value) for value in limits],
        "following_error_limit": [_number(options.following_error_limit / scale)] * n,
        "hold_speed": _number(options.hold_speed),
        "minimum_radius": _number(options.minimum_radius),
        "licence": options.license,
        "licence_text": LICENCES[str(options.license)],
        "statuses": ", ".join(f"{k} {text}" for k, text in enumerate(facts.statuses)),
        "gains": gains,
        "hidden": hidden,
        "telemetry": telemetry_items(generated),
        "defaults": generated.defaults,
        "needs_acceleration": any(
            f.path.startswith("geometry") or f.path.endswith(("acceleration", "jerk"))
            for f in generated.inputs
        ),
    }


def _number(value: float) -> str:
    """Return a float as C and HAL read it, to the last bit."""
    text = f"{float(value):.17g}"
    return text if any(c in text for c in ".e") else f"{text}.0"


def _refuse_prefix(prefix: str) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", prefix) or len(prefix) > 20:
        raise ConfigurationError(
            "prefix must be at most 20 lower case letters, digits and single underscores, "
            f"beginning with a letter, to be the name of a HAL component; got {prefix!r}"
        )


def _joints(options: LinuxcncOptions, n: int) -> list[int]:
    joints = list(range(n)) if options.joints is None else [int(j) for j in options.joints]
    if len(joints) != n or len(set(joints)) != n or min(joints) < 0:
        raise ConfigurationError(
            f"joints must be {n} different numbers >= 0, one for each axis of the law, got {joints}"
        )
    return joints


def _limits(facts: LawFacts, options: LinuxcncOptions, scale: float) -> list[float]:
    """Return the limit of each command pin, in its unit."""
    n, kind = facts.n_axes, facts.needs.command
    given = options.command_limit
    if given is None:
        limits = list(facts.command_limit)
        if kind == "position":  # the law has none in this sense
            limits = [options.following_error_limit] * n
    else:
        limits = (
            [float(given)] * n if isinstance(given, (int, float)) else [float(x) for x in given]
        )
    if len(limits) != n or not all(limit > 0.0 for limit in limits):
        raise ConfigurationError(
            f"command_limit must be > 0 {COMMAND_UNITS[kind]}, one number or one for each of the "
            f"{n} axes, got {given}"
        )
    if not all(math.isfinite(limit) for limit in limits):
        raise RefusedError(
            f"{facts.name} has no command limit, and a real drive must have one: say "
            f"command_limit [{COMMAND_UNITS[kind]}], or give the model of the law a limit"
        )
    return [limit / scale for limit in limits]
