"""The ``[machine]`` section of a scenario."""

from __future__ import annotations

import inspect
import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from contourlab.configuration import replace, replace_at, resolve
from contourlab.errors import ConfigurationError, ContourlabError, choices
from contourlab.feedrate import AxisLimits
from contourlab.machines import Drive, LinearTool, Machine
from contourlab.scenarios import registry
from contourlab.scenarios.axes import all_or_none, dynamics_of, errors_of, nominal_of, sensor_of
from contourlab.scenarios.locate import Key
from contourlab.scenarios.machine_schema import AxisSection, MachineSection
from contourlab.scenarios.refusal import located
from contourlab.scenarios.values import KeyedError, at, field_value, needs_unit

__all__ = ["build_machine"]

_ARGUMENTS = {"encoder": "length"}
"""Kinds of quantity of the arguments of named machines; the others are plain numbers.

``computing_delay`` is a key of ``[machine]`` itself.
"""
_COUNTS = {"n_axes"}


def build_machine(
    section: MachineSection, substeps: int | None, folder: str | FilePath = "."
) -> Machine:
    """Return the machine of a scenario.

    Parameters
    ----------
    section
        ``[machine]``.
    substeps
        ``[simulation] substeps``, if given.
    folder
        Where a machine file that it names is looked for.

    Raises
    ------
    KeyedError
        Something in it is wrong; says at which key.
    """
    if section.name is not None:
        machine = _named(section)
    elif section.file is not None:
        machine = _from_file(section, FilePath(folder))
    else:
        machine = _of_axes(section)
    for path, value in section.set.items():
        machine = _changed(machine, path, value)
    if section.substeps is not None:
        machine = _with_substeps(machine, section.substeps, ("machine", "substeps"))
    if substeps is not None:
        machine = _with_substeps(machine, substeps, ("simulation", "substeps"))
    return machine


def _with_substeps(machine: Machine, substeps: int, key: Key) -> Machine:
    if not machine.dynamics.uses_substeps:
        raise KeyedError(
            key,
            "substeps are for dry friction, backlash and cogging, which this machine does not "
            "have; remove it",
        )
    return replace(machine, substeps=substeps)


def _from_file(section: MachineSection, folder: FilePath) -> Machine:
    from contourlab.scenarios.machine_file import read_machine_file

    assert section.file is not None
    with at("machine", "file"):
        machine = read_machine_file(folder / section.file)
    return _overridden(machine, section)


def _overridden(machine: Machine, section: MachineSection) -> Machine:
    if section.computing_delay is not None:
        with at("machine", "computing_delay"):
            machine = replace_at(machine, "drive.computing_delay", section.computing_delay)
    if section.velocity is not None:
        machine = replace_at(machine, "sensor.velocity", section.velocity)
    return machine


def _named(section: MachineSection) -> Machine:
    with at("machine", "name"):
        function = registry.lookup("machine", section.name, registry.machines())
    arguments: dict[str, Any] = {}
    parameters = inspect.signature(function).parameters
    allowed = set(parameters)
    for name, value in (section.model_extra or {}).items():
        if name not in allowed:
            known = {*allowed, "name", "set", "computing_delay", "substeps", "velocity"}
            raise KeyedError(("machine", name), f"unknown key; {choices(name, known)}")
        with at("machine", name):
            arguments[name] = _argument(name, value, parameters[name].default)
    with at("machine", *arguments) if len(arguments) == 1 else at("machine"):
        machine: Machine = function(**arguments)
    return _overridden(machine, section)


def _argument(name: str, value: Any, default: Any) -> Any:
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise ConfigurationError(f"{name} must be true or false, got {value!r}")
        return value
    if isinstance(value, list):
        raise ConfigurationError(f"must be a single value, got {value!r}")
    if name in _COUNTS:
        if isinstance(value, bool) or not isinstance(value, int):
            raise ConfigurationError(f"must be a whole number, got {value!r}")
        return value
    return field_value(name, value, _ARGUMENTS.get(name))


def _changed(machine: Machine, path: str, value: Any) -> Machine:
    key = ("machine", "set", path)
    try:
        full = resolve(machine, path)
        *inner, last = full.split(".")
        owner: Any = machine
        for name in inner:
            owner = owner[int(name)] if isinstance(owner, tuple) else getattr(owner, name)
        field = owner.__dataclass_fields__[last]
        if "choice" in field.metadata:
            if field.name == "computing_delay":
                value = field_value(last, value, "time")
            return replace_at(machine, full, tuple(value) if isinstance(value, list) else value)
        number = field_value(last, value, needs_unit(field))
        return replace_at(machine, full, number)
    except ContourlabError as error:
        raise KeyedError(key, str(error)) from error


def _of_axes(section: MachineSection) -> Machine:
    axes = section.axis or []
    optional: dict[str, Any] = {}
    planned = all_or_none(axes, "velocity_limit", [axis.velocity_limit for axis in axes])
    if section.tool_matrix is not None:
        with at("machine", "tool_matrix"):
            if len({len(row) for row in section.tool_matrix}) != 1:
                raise ConfigurationError("tool_matrix must be rows of one length")
            optional["tool"] = LinearTool(matrix=np.asarray(section.tool_matrix, float))
    with at("machine", "axis"):
        return Machine(
            names=tuple(axis.name for axis in axes),
            dynamics=dynamics_of(section),
            drive=located(axes, partial(_drive, section)),
            sensor=sensor_of(section),
            errors=errors_of(section),
            travel=_travel(axes),
            limits=located(axes, _limits) if planned else None,
            nominal_model=nominal_of(section),
            assumed=tuple(section.assumed), title=section.title, source=section.source,
            **optional,
        )  # fmt: skip


def _drive(section: MachineSection, axes: Sequence[AxisSection]) -> Drive:
    assert section.command is not None  # the schema asks for it
    return Drive(
        command=section.command,
        command_limit=[
            np.inf if axis.command_limit is None else axis.command_limit for axis in axes
        ],
        computing_delay=section.computing_delay or 0.0,
    )


def _limits(axes: Sequence[AxisSection]) -> AxisLimits:
    return AxisLimits(
        velocity=np.array([axis.velocity_limit for axis in axes]),
        acceleration=np.array([axis.acceleration_limit for axis in axes]),
        jerk=np.array([axis.jerk_limit for axis in axes]),
    )


def _travel(axes: Sequence[AxisSection]) -> list[list[float]]:
    """Lower and upper end of every axis [m]; what is unlimited was read as NaN."""
    ends = []
    for k, axis in enumerate(axes):
        low, high = axis.travel or [math.nan, math.nan]
        if low >= high:
            raise KeyedError(
                ("machine", "axis", k, "travel"),
                f"travel of axis {axis.name} must have lower < upper, got {low:g} to {high:g} m",
            )
        ends.append([-math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high])
    return ends
