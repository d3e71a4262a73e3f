"""The ``[machine]`` section of a scenario."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np

from contourlab.configuration import replace, replace_at, resolve
from contourlab.errors import ConfigurationError, ContourlabError, choices
from contourlab.feedrate import AxisLimits
from contourlab.machines import Drive, Encoder, Friction, Machine, RigidAxes, TransferFunctionAxes
from contourlab.scenarios import registry
from contourlab.scenarios.schema import AxisSection, MachineSection
from contourlab.scenarios.values import KeyedError, at, field_value, needs_unit

__all__ = ["build_machine"]

_ARGUMENTS = {"encoder": "length"}
"""Kinds of quantity of the arguments of named machines; the others are plain numbers.

``computing_delay`` is a key of ``[machine]`` itself.
"""
_COUNTS = {"n_axes"}


def build_machine(section: MachineSection, substeps: int | None) -> Machine:
    """Return the machine of a scenario.

    Parameters
    ----------
    section
        ``[machine]``.
    substeps
        ``[simulation] substeps``, if given.

    Raises
    ------
    KeyedError
        Something in it is wrong; says at which key.
    """
    machine = _named(section) if section.name is not None else _of_axes(section)
    for path, value in section.set.items():
        machine = _changed(machine, path, value)
    if substeps is not None:
        if getattr(machine.dynamics, "friction", None) is None:
            raise KeyedError(
                ("simulation", "substeps"),
                "substeps are for dry friction, which this machine does not have; remove it",
            )
        machine = replace(machine, substeps=substeps)
    return machine


def _named(section: MachineSection) -> Machine:
    with at("machine", "name"):
        function = registry.lookup("machine", section.name, registry.machines())
    arguments: dict[str, Any] = {}
    allowed = set(inspect.signature(function).parameters)
    for name, value in (section.model_extra or {}).items():
        if name not in allowed:
            known = {*allowed, "name", "set", "computing_delay", "velocity"}
            raise KeyedError(("machine", name), f"unknown key; {choices(name, known)}")
        with at("machine", name):
            arguments[name] = _argument(name, value)
    with at("machine", *arguments) if len(arguments) == 1 else at("machine"):
        machine: Machine = function(**arguments)
    if section.computing_delay is not None:
        with at("machine", "computing_delay"):
            machine = replace_at(machine, "drive.computing_delay", section.computing_delay)
    if section.velocity is not None:
        machine = replace_at(machine, "sensor.velocity", section.velocity)
    return machine


def _argument(name: str, value: Any) -> Any:
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
    assert section.command is not None  # the schema asks for it
    try:
        friction = None
        if any(axis.coulomb or axis.breakaway for axis in axes):
            friction = Friction(
                coulomb=[axis.coulomb for axis in axes],
                breakaway=[
                    axis.coulomb if axis.breakaway is None else axis.breakaway for axis in axes
                ],
                stribeck_velocity=[axis.stribeck_velocity for axis in axes],
                smoothing_velocity=[axis.smoothing_velocity for axis in axes],
            )
        by_mass = [axis.mass is not None for axis in axes]
        if any(by_mass) and not all(by_mass):
            raise KeyedError(
                ("machine", "axis", by_mass.index(False)),
                "axes by mass and axes by transfer function cannot be mixed",
            )
        dynamics: Any
        if all(by_mass):
            dynamics = RigidAxes(
                mass=[axis.mass or 0.0 for axis in axes],
                viscous=[axis.viscous for axis in axes],
                gain=[axis.gain for axis in axes],
                friction=friction,
            )
        else:
            dynamics = TransferFunctionAxes(
                numerators=tuple(axis.numerator or () for axis in axes),
                denominators=tuple(axis.denominator or () for axis in axes),
            )
        noise = [axis.noise for axis in axes]
        return Machine(
            names=tuple(axis.name for axis in axes),
            dynamics=dynamics,
            drive=Drive(
                command=section.command,
                command_limit=[
                    np.inf if axis.command_limit is None else axis.command_limit for axis in axes
                ],
                computing_delay=section.computing_delay or 0.0,
            ),
            sensor=Encoder(
                resolution=[axis.resolution for axis in axes],
                noise=noise if any(noise) else None,
                velocity=section.velocity or "difference",
            ),
            travel=[axis.travel or [-np.inf, np.inf] for axis in axes],
            limits=_limits(axes),
        )
    except KeyedError:
        raise
    except ContourlabError as error:
        raise KeyedError(("machine", "axis"), str(error)) from error


def _limits(axes: list[AxisSection]) -> AxisLimits:
    return AxisLimits(
        velocity=np.array([axis.velocity_limit for axis in axes]),
        acceleration=np.array([axis.acceleration_limit for axis in axes]),
        jerk=np.array([axis.jerk_limit for axis in axes]),
    )
