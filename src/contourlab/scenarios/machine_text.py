"""A machine as the text of a machine file."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np

from contourlab.errors import ConfigurationError
from contourlab.machines import (
    BallScrewAxes,
    Friction,
    GeometricErrors,
    IdentityTool,
    LinearTool,
    Machine,
    PositionError,
    RigidAxes,
    StateSpaceAxes,
    TransferFunctionAxes,
    TwoMassAxes,
)
from contourlab.machines.base import per_axis

__all__ = ["machine_to_toml"]

Table = dict[str, Any]
"""Keys and values, in order; a value is text, number, list, table, or list of tables."""


class Quantity(str):
    """A number with its unit, as it will stand in the file."""

    __slots__ = ()


def machine_to_toml(machine: Machine) -> str:
    """Return the text of a machine file that gives the machine back.

    Every field is written for each axis, also where one number stood for all.

    Parameters
    ----------
    machine
        As for :func:`write_machine_file`.

    Raises
    ------
    ConfigurationError
        A batch of machines, a part of a class that the format does not know, or a value that is
        traced.
    """
    for leaf in jax.tree.leaves(machine):
        if isinstance(leaf, jax.core.Tracer):
            raise ConfigurationError("the machine is traced: it has no numbers to write yet")
    top: Table = {}
    for name in ("title", "source"):
        if getattr(machine, name):
            top[name] = getattr(machine, name)
    if machine.assumed:
        top["assumed"] = list(machine.assumed)
    top["command"] = machine.command
    if machine.drive.computing_delay:
        top["computing_delay"] = _quantity(machine.drive.computing_delay, "s")
    top["velocity"] = machine.sensor.velocity
    if machine.dynamics.uses_substeps:
        top["substeps"] = machine.substeps
    if isinstance(machine.tool, LinearTool):
        top["tool_matrix"] = _matrix("tool.matrix", machine.tool.matrix)
    elif not isinstance(machine.tool, IdentityTool):
        raise ConfigurationError(
            f"a tool of class {type(machine.tool).__name__} cannot be written: only IdentityTool "
            "and LinearTool have a place in machine files"
        )
    axes: list[Table] = [{"name": name} for name in machine.names]
    _write_dynamics(machine, top, axes)
    _write_drive(machine, axes)
    _write_sensor(machine, axes)
    if machine.errors is not None:
        _write_errors(machine.errors, top, axes)
    _write_nominal(machine, axes)
    top["axis"] = axes
    return _text(top)


def _column(name: str, value: Any, n_axes: int) -> list[float]:
    row = np.asarray(per_axis(name, value, n_axes))
    if row.ndim != 1:
        raise ConfigurationError(
            f"a batch of machines cannot be written: {name} has shape {np.shape(value)}"
        )
    return [float(x) for x in row]


def _matrix(name: str, value: Any) -> list[list[float]]:
    table = np.asarray(value, float)
    if table.ndim != 2:
        raise ConfigurationError(
            f"a batch of machines cannot be written: {name} has shape {table.shape}"
        )
    return [[float(x) for x in row] for row in table]


def _quantity(value: float, unit: str) -> Quantity:
    return Quantity(f"{_number(float(value))} {unit}")


def _put(axes: list[Table], key: str, values: list[float], unit: str = "") -> None:
    for table, value in zip(axes, values, strict=True):
        table[key] = _quantity(value, unit) if unit else value


def _sub(axes: list[Table], key: str) -> list[Table]:
    for table in axes:
        table[key] = {}
    return [table[key] for table in axes]


def _write_friction(friction: Friction | None, axes: list[Table], *, nested: bool) -> None:
    """Flat, or as tables of their own, where zero must be said."""
    if friction is None:
        return
    if type(friction) is not Friction:
        raise ConfigurationError(
            f"friction of the kind {type(friction).__name__} cannot be written in a machine file; "
            "Friction can"
        )
    n_axes = len(axes)
    columns = {
        f.name: _column(f"friction.{f.name}", getattr(friction, f.name), n_axes)
        for f in dataclasses.fields(friction)
        if getattr(friction, f.name) is not None
    }
    for k, table in enumerate(axes):
        row = {name: values[k] for name, values in columns.items()}
        dry = row["coulomb"] or row.get("breakaway")
        for name in ("coulomb", "coulomb_backward", "breakaway"):
            if name in row:
                table[name] = row[name]
        if nested or row.get("breakaway"):
            table["stribeck_velocity"] = _quantity(row["stribeck_velocity"], "m/s")
        if nested or dry:
            table["smoothing_velocity"] = _quantity(row["smoothing_velocity"], "m/s")


def _write_cogging(harmonics: Any, axes: list[Table]) -> None:
    n_axes = len(axes)
    for harmonic in harmonics:
        amplitude, period, phase = (
            _column(f"cogging.{name}", getattr(harmonic, name), n_axes)
            for name in ("amplitude", "period", "phase")
        )
        for k, table in enumerate(axes):
            table.setdefault("cogging", []).append(
                {
                    "amplitude": amplitude[k],
                    "period": _quantity(period[k], "m"),
                    "phase": _quantity(phase[k], "rad"),
                }
            )


def _write_dynamics(machine: Machine, top: Table, axes: list[Table]) -> None:
    dynamics = machine.dynamics
    for kind, write in _WRITERS.items():
        if type(dynamics) is kind:
            write(dynamics, top, axes)
            return
    raise ConfigurationError(
        f"dynamics of class {type(dynamics).__name__} cannot be written; machine files know "
        + ", ".join(kind.__name__ for kind in _WRITERS)
    )


def _write_rigid(dynamics: RigidAxes, top: Table, axes: list[Table]) -> None:
    for name in ("mass", "viscous", "gain"):
        _put(axes, name, _column(name, getattr(dynamics, name), len(axes)))
    _write_friction(dynamics.friction, axes, nested=False)
    _write_cogging(dynamics.cogging, axes)


def _write_transfer_function(dynamics: TransferFunctionAxes, top: Table, axes: list[Table]) -> None:
    for k, table in enumerate(axes):
        for key, polynomials in (
            ("numerator", dynamics.numerators),
            ("denominator", dynamics.denominators),
        ):
            row = np.asarray(polynomials[k], float)
            if row.ndim != 1:
                raise ConfigurationError(
                    f"a batch of machines cannot be written: {key}s has shape {row.shape}"
                )
            table[key] = [float(x) for x in row]


def _write_two_mass(dynamics: TwoMassAxes, top: Table, axes: list[Table]) -> None:
    inner = _sub(axes, "two_mass")
    for name in ("motor_mass", "load_mass", "stiffness", "damping", "motor_viscous",
                 "load_viscous", "gain"):  # fmt: skip
        _put(inner, name, _column(name, getattr(dynamics, name), len(axes)))
    if dynamics.backlash is not None:
        _put(inner, "backlash", _column("backlash", dynamics.backlash, len(axes)), "m")
    if dynamics.motor_friction is not None:
        _write_friction(dynamics.motor_friction, _sub(inner, "motor_friction"), nested=True)
    _write_friction(dynamics.load_friction, axes, nested=False)
    _write_cogging(dynamics.cogging, axes)


_BALL_SCREW = {
    "lead": ("lead", "m"),
    "motor_inertia": ("motor_inertia_kg_m2", ""),
    "screw_inertia": ("screw_inertia_kg_m2", ""),
    "table_mass": ("table_mass_kg", ""),
    "motor_viscous": ("motor_viscous_n_m_s", ""),
    "table_viscous": ("table_viscous_n_s_per_m", ""),
    "torque_constant": ("torque_constant_n_m_per_a", ""),
    "amplifier_gain": ("amplifier_gain_a_per_v", ""),
    "stiffness": ("stiffness_n_per_m", ""),
    "damping_ratio": ("damping_ratio", ""),
    "backlash": ("backlash", "m"),
}


def _write_ball_screw(dynamics: BallScrewAxes, top: Table, axes: list[Table]) -> None:
    inner = _sub(axes, "ball_screw")
    for field, (key, unit) in _BALL_SCREW.items():
        value = getattr(dynamics, field)
        if value is not None:
            _put(inner, key, _column(field, value, len(axes)), unit)
    if dynamics.motor_friction is not None:
        _write_friction(dynamics.motor_friction, _sub(inner, "motor_friction"), nested=True)
    _write_friction(dynamics.table_friction, axes, nested=False)
    _write_cogging(dynamics.cogging, axes)


def _write_state_space(dynamics: StateSpaceAxes, top: Table, axes: list[Table]) -> None:
    table: Table = {
        name: _matrix(name, getattr(dynamics, name))
        for name in ("state_matrix", "input_matrix", "output_matrix", "direct_matrix")
        if getattr(dynamics, name) is not None
    }
    if dynamics.sample_time is not None:
        table["sample_time"] = _quantity(dynamics.sample_time, "s")
    table["output"] = dynamics.output
    top["state_space"] = table


_WRITERS: Mapping[type, Callable[..., None]] = {
    RigidAxes: _write_rigid,
    TransferFunctionAxes: _write_transfer_function,
    TwoMassAxes: _write_two_mass,
    BallScrewAxes: _write_ball_screw,
    StateSpaceAxes: _write_state_space,
}


def _write_drive(machine: Machine, axes: list[Table]) -> None:
    n_axes = len(axes)
    limit = _column("command_limit", machine.drive.command_limit, n_axes)
    ends = np.broadcast_to(np.asarray(machine.travel, float), (n_axes, 2))
    for k, table in enumerate(axes):
        if math.isfinite(limit[k]):
            table["command_limit"] = limit[k]
        if np.isfinite(ends[k]).any():
            table["travel"] = [
                _quantity(end, "m") if math.isfinite(end) else "unlimited" for end in ends[k]
            ]
    if machine.limits is not None:
        for name, unit in (("velocity", "m/s"), ("acceleration", "m/s^2"), ("jerk", "m/s^3")):
            values = _column(f"limits.{name}", getattr(machine.limits, name), n_axes)
            _put(axes, f"{name}_limit", values, unit)


def _write_sensor(machine: Machine, axes: list[Table]) -> None:
    n_axes, sensor = len(axes), machine.sensor
    _put(axes, "resolution", _column("resolution", sensor.resolution, n_axes), "m")
    if sensor.noise is not None:
        _put(axes, "noise", _column("noise", sensor.noise, n_axes), "m")
    # on a rigid axis without an error of its screw both sides are one: the file says neither
    screw = None if machine.errors is None else machine.errors.screw
    one = isinstance(machine.dynamics, RigidAxes) and screw is None
    for key, sides in (("measured", sensor.side), ("velocity_measured", sensor.velocity_side)):
        if sides is not None and not (one and "motor" in sides):
            each = sides if isinstance(sides, tuple) else (sides,) * n_axes
            for table, side in zip(axes, each, strict=True):
                table[key] = side


def _write_errors(errors: GeometricErrors, top: Table, axes: list[Table]) -> None:
    n_axes = len(axes)
    for key, error in (("screw_error", errors.screw), ("scale_error", errors.scale)):
        if error is None:
            continue
        tables = _sub(axes, key)
        for field in dataclasses.fields(PositionError):
            unit = {"amplitude": "m", "period": "m", "phase": "rad"}.get(field.name, "")
            values = _column(f"errors.{field.name}", getattr(error, field.name), n_axes)
            _put(tables, field.name, values, unit)
    if errors.squareness:
        top["squareness"] = [
            {"axes": list(pair.axes), "angle": _quantity(float(np.asarray(pair.angle)), "rad")}
            for pair in errors.squareness
        ]


def _write_nominal(machine: Machine, axes: list[Table]) -> None:
    model = machine.nominal_model
    if model is None:
        return
    tables = _sub(axes, "nominal")
    for name in ("mass", "viscous", "coulomb", "gain"):
        _put(tables, name, _column(f"nominal_model.{name}", getattr(model, name), len(axes)))
    if model.stiffness is not None:
        stiffness = _column("nominal_model.stiffness", model.stiffness, len(axes))
        _put(tables, "stiffness", stiffness)
    limit = _column("nominal_model.command_limit", model.command_limit, len(axes))
    for table, value in zip(tables, limit, strict=True):
        if math.isfinite(value):
            table["command_limit"] = value


def _number(value: float) -> str:
    text = repr(value)  # the shortest that gives the number back: people edit these files
    return text if any(mark in text for mark in ".en") else f"{text}.0"


def _string(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    controls = {"\n": "\\n", "\t": "\\t", "\r": "\\r"}
    shown = "".join(
        controls.get(c, f"\\u{ord(c):04x}") if ord(c) < 32 or ord(c) == 127 else c for c in escaped
    )
    return f'"{shown}"'


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return _number(value)
    return f"[{', '.join(_value(item) for item in value)}]"


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict)


def _text(table: Table, prefix: str = "") -> str:
    lines = [
        f"{key} = {_value(value)}"
        for key, value in table.items()
        if not isinstance(value, dict) and not _is_tables(value)
    ]
    text = "\n".join(lines) + ("\n" if lines else "")
    for key, value in table.items():
        if isinstance(value, dict):
            text += f"\n[{prefix}{key}]\n{_text(value, f'{prefix}{key}.')}"
        elif _is_tables(value):
            for entry in value:
                text += f"\n[[{prefix}{key}]]\n{_text(entry, f'{prefix}{key}.')}"
    return text
