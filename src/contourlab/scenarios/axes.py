"""From ``[[machine.axis]]`` to the parts of a machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from contourlab.errors import ConfigurationError
from contourlab.feedrate import AxisLimits
from contourlab.machines import (
    BallScrewAxes,
    Cogging,
    Encoder,
    Friction,
    GeometricErrors,
    NominalModel,
    PositionError,
    RigidAxes,
    Squareness,
    StateSpaceAxes,
    TransferFunctionAxes,
    TwoMassAxes,
)
from contourlab.machines.base import Dynamics
from contourlab.scenarios.machine_schema import (
    AxisSection,
    FrictionSection,
    MachineSection,
    StateSpaceSection,
)
from contourlab.scenarios.values import KeyedError, at

__all__ = ["dynamics_of", "errors_of", "limits_of", "nominal_of", "sensor_of", "travel_of"]

Axes = list[AxisSection]


def dynamics_of(section: MachineSection) -> Dynamics:
    """Return how the axes answer.

    Parameters
    ----------
    section
        ``[machine]``, with axes.

    Raises
    ------
    KeyedError
        Axes of several kinds, or values that do not go together; says at which key.
    """
    axes = section.axis or []
    if section.state_space is not None:
        with at("machine", "state_space"):
            return _state_space(section.state_space)
    kinds = [axis.kind for axis in axes]
    for k, kind in enumerate(kinds):
        if kind != kinds[0]:
            raise KeyedError(
                ("machine", "axis", k),
                f"axes by {_WORDS[kinds[0]]} and axes by {_WORDS[kind]} cannot be mixed",
            )
    return _BUILDERS[kinds[0]](axes)


_WORDS: dict[str | None, str] = {
    "mass": "mass",
    "numerator": "transfer function",
    "two_mass": "two_mass",
    "ball_screw": "ball_screw",
    "state_space": "state_space",
}


def _filled(values: Sequence[Any], default: Any) -> list[Any] | None:
    """Values with a default where they are not given; None if none is given."""
    if all(value is None for value in values):
        return None
    return [default if value is None else value for value in values]


def _all_or_none(axes: Axes, name: str, values: Sequence[Any]) -> list[Any] | None:
    given = [value is not None for value in values]
    if any(given) and not all(given):
        k = given.index(False)
        raise KeyedError(
            ("machine", "axis", k),
            f"axis {axes[k].name}: {name} is given for other axes and must be for all",
        )
    return list(values) if any(given) else None


def _friction(sections: Sequence[AxisSection | FrictionSection | None]) -> Friction | None:
    """The friction of all axes: zero where an axis has none; None if no axis has any."""
    given = [s or FrictionSection(coulomb=0.0) for s in sections]
    if not any(s.coulomb or s.coulomb_backward or s.breakaway for s in given):
        return None

    def level(name: str) -> list[float] | None:
        values = [getattr(s, name) for s in given]
        if all(value is None for value in values):
            return None
        return [s.coulomb if v is None else v for s, v in zip(given, values, strict=True)]

    return Friction(
        coulomb=[s.coulomb for s in given],
        coulomb_backward=level("coulomb_backward"),
        breakaway=level("breakaway"),
        stribeck_velocity=[s.stribeck_velocity for s in given],
        smoothing_velocity=[s.smoothing_velocity for s in given],
    )


def _cogging(axes: Axes) -> tuple[Cogging, ...]:
    """One harmonic for each row; axes with fewer harmonics have zeros in the others."""
    count = max(len(axis.cogging) for axis in axes)
    harmonics = []
    for k in range(count):
        rows = [axis.cogging[k] if k < len(axis.cogging) else None for axis in axes]
        harmonics.append(
            Cogging(
                amplitude=[0.0 if row is None else row.amplitude for row in rows],
                period=[1.0 if row is None else row.period for row in rows],
                phase=[0.0 if row is None else row.phase for row in rows],
            )
        )
    return tuple(harmonics)


def _rigid(axes: Axes) -> Dynamics:
    with at("machine", "axis"):
        return RigidAxes(
            mass=[axis.mass or 0.0 for axis in axes],
            viscous=[axis.viscous for axis in axes],
            gain=[axis.gain for axis in axes],
            friction=_friction(axes), cogging=_cogging(axes),
        )  # fmt: skip


def _transfer_function(axes: Axes) -> Dynamics:
    with at("machine", "axis"):
        return TransferFunctionAxes(
            numerators=tuple(axis.numerator or () for axis in axes),
            denominators=tuple(axis.denominator or () for axis in axes),
        )


def _two_mass(axes: Axes) -> Dynamics:
    names = ("motor_mass", "load_mass", "stiffness", "damping", "motor_viscous", "load_viscous",
             "gain")  # fmt: skip
    ones: list[dict[str, Any]] = []
    for k, axis in enumerate(axes):
        own = axis.two_mass
        assert own is not None
        common: dict[str, Any] = {
            name: getattr(own, name) for name in ("motor_viscous", "load_viscous", "gain")
        }
        with at("machine", "axis", k, "two_mass"):
            if own.stiffness is None:
                one = TwoMassAxes.by_frequency(
                    mass=own.mass or 0.0, mass_ratio=own.mass_ratio or 0.0,
                    anti_resonance_hz=own.anti_resonance_hz or 0.0,
                    damping_ratio=own.damping_ratio or 0.0, **common,
                )  # fmt: skip
            else:
                one = TwoMassAxes(
                    motor_mass=own.motor_mass or 0.0, load_mass=own.load_mass or 0.0,
                    stiffness=own.stiffness, damping=own.damping or 0.0, **common,
                )  # fmt: skip
        ones.append({name: float(np.asarray(getattr(one, name))) for name in names})
    parts = [axis.two_mass for axis in axes]
    with at("machine", "axis"):
        return TwoMassAxes(
            **{name: [one[name] for one in ones] for name in names},
            motor_friction=_friction([p.motor_friction if p else None for p in parts]),
            load_friction=_friction(axes),
            backlash=_filled([p.backlash if p else None for p in parts], 0.0),
            cogging=_cogging(axes),
        )


def _ball_screw(axes: Axes) -> Dynamics:
    parts = [axis.ball_screw for axis in axes]

    def column(name: str) -> list[Any]:
        return [getattr(part, name) for part in parts]

    return_all = {
        field: _all_or_none(axes, f"ball_screw.{key}", column(key))
        for field, key in (
            ("torque_constant", "torque_constant_n_m_per_a"),
            ("stiffness", "stiffness_n_per_m"),
            ("damping_ratio", "damping_ratio"),
        )
    }
    with at("machine", "axis"):
        return BallScrewAxes(
            lead=column("lead"), motor_inertia=column("motor_inertia_kg_m2"),
            screw_inertia=column("screw_inertia_kg_m2"), table_mass=column("table_mass_kg"),
            motor_viscous=column("motor_viscous_n_m_s"),
            table_viscous=column("table_viscous_n_s_per_m"),
            amplifier_gain=_filled(column("amplifier_gain_a_per_v"), 1.0),
            backlash=_filled(column("backlash"), 0.0),
            motor_friction=_friction(column("motor_friction")), table_friction=_friction(axes),
            cogging=_cogging(axes), **return_all,
        )  # fmt: skip


def _state_space(section: StateSpaceSection) -> StateSpaceAxes:
    values = {name: getattr(section, name) for name in StateSpaceSection.model_fields}
    resample = values.pop("resample")
    model = StateSpaceAxes(**values)
    return model.continuous() if resample else model


def _state_spaces(axes: Axes) -> Dynamics:
    models = []
    for k, axis in enumerate(axes):
        assert axis.state_space is not None
        with at("machine", "axis", k, "state_space"):
            model = _state_space(axis.state_space)
            model.check_axes(1)
            models.append(model)
    with at("machine", "axis"):
        return StateSpaceAxes.per_axis(models)


_BUILDERS: dict[str | None, Callable[[Axes], Dynamics]] = {
    "mass": _rigid,
    "numerator": _transfer_function,
    "two_mass": _two_mass,
    "ball_screw": _ball_screw,
    "state_space": _state_spaces,
}


def sensor_of(section: MachineSection) -> Encoder:
    """Return what is measured.

    Parameters
    ----------
    section
        ``[machine]``, with axes.
    """
    axes = section.axis or []
    noise = [axis.noise for axis in axes]
    sides: Any = tuple(axis.measured for axis in axes)
    rates: Any = tuple(axis.velocity_measured or axis.measured for axis in axes)
    return Encoder(
        resolution=[axis.resolution for axis in axes],
        noise=noise if any(noise) else None,
        velocity=section.velocity or "difference",
        side=sides[0] if len(set(sides)) == 1 else sides,
        velocity_side=None if rates == sides else rates[0] if len(set(rates)) == 1 else rates,
    )


def errors_of(section: MachineSection) -> GeometricErrors | None:
    """Return the geometric errors, None if there are none.

    Parameters
    ----------
    section
        ``[machine]``, with axes.
    """
    axes = section.axis or []

    def along(name: str) -> PositionError | None:
        rows = [getattr(axis, name) for axis in axes]
        if all(row is None for row in rows):
            return None
        return PositionError(
            scale=[0.0 if row is None else row.scale for row in rows],
            amplitude=[0.0 if row is None else row.amplitude for row in rows],
            period=[1.0 if row is None or row.period is None else row.period for row in rows],
            phase=[0.0 if row is None else row.phase for row in rows],
        )

    pairs: list[Squareness] = []
    for k, pair in enumerate(section.squareness):
        with at("machine", "squareness", k):
            if len(pair.axes) != 2:
                raise ConfigurationError(f"axes must name two different axes, got {pair.axes!r}")
            pairs.append(Squareness(axes=(pair.axes[0], pair.axes[1]), angle=pair.angle))
    errors = GeometricErrors(
        screw=along("screw_error"), scale=along("scale_error"), squareness=tuple(pairs)
    )
    if errors.screw is None and errors.scale is None and not pairs:
        return None
    return errors


def nominal_of(section: MachineSection) -> NominalModel | None:
    """Return what laws are told instead of the truth, None if it is not given.

    Parameters
    ----------
    section
        ``[machine]``, with axes.
    """
    axes = section.axis or []
    rows = _all_or_none(axes, "nominal", [axis.nominal for axis in axes])
    if rows is None:
        return None
    assert section.command is not None
    return NominalModel(
        mass=np.array([row.mass for row in rows]),
        viscous=np.array([row.viscous for row in rows]),
        coulomb=np.array([row.coulomb for row in rows]),
        gain=np.array([row.gain for row in rows]),
        command_limit=np.array(
            [math.inf if row.command_limit is None else row.command_limit for row in rows]
        ),
        command=section.command,
    )


def limits_of(axes: Axes) -> AxisLimits | None:
    """Return what planning may ask, None if it is not given.

    Parameters
    ----------
    axes
        Of the machine.
    """
    rows = _all_or_none(axes, "velocity_limit", [axis.velocity_limit for axis in axes])
    if rows is None:
        return None
    return AxisLimits(
        velocity=np.array([axis.velocity_limit for axis in axes]),
        acceleration=np.array([axis.acceleration_limit for axis in axes]),
        jerk=np.array([axis.jerk_limit for axis in axes]),
    )


def travel_of(axes: Axes) -> list[list[float]]:
    """Return lower and upper end of every axis [m].

    Parameters
    ----------
    axes
        Of the machine.
    """
    ends = []
    for axis in axes:
        low, high = axis.travel or [math.nan, math.nan]
        ends.append([-math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high])
    return ends
