"""From ``[[machine.axis]]`` to the parts of a machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from contourlab.errors import ConfigurationError
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
    PositionErrorSection,
    StateSpaceSection,
)
from contourlab.scenarios.refusal import inner, located
from contourlab.scenarios.values import KeyedError, at

__all__ = ["all_or_none", "dynamics_of", "errors_of", "nominal_of", "sensor_of"]

Axes = Sequence[AxisSection]


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
    with at("machine", "axis"):
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


def all_or_none(axes: Axes, name: str, values: Sequence[Any]) -> list[Any] | None:
    """Return values that are given for all axes, None if they are for none.

    Parameters
    ----------
    axes
        Of the machine.
    name
        Of the values, for messages.
    values
        One per axis, None where it is not given.

    Raises
    ------
    KeyedError
        Given for some axes only; says which one lacks it.
    """
    given = [value is not None for value in values]
    if any(given) and not all(given):
        k = given.index(False)
        raise KeyedError(
            ("machine", "axis", k),
            f"axis {axes[k].name}: {name} is given for other axes and must be for all",
        )
    return list(values) if any(given) else None


def _friction(axes: Axes, *path: str) -> Friction | None:
    """The friction at a path of all axes: zero where one has none; None if no axis has any."""
    return located(axes, lambda some: _friction_of([inner(axis, path) for axis in some]), *path)


def _friction_of(sections: Sequence[AxisSection | FrictionSection | None]) -> Friction | None:
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

    def harmonic(k: int, some: Axes) -> Cogging:
        rows = [inner(axis, ("cogging", k)) for axis in some]
        return Cogging(
            amplitude=[0.0 if row is None else row.amplitude for row in rows],
            period=[1.0 if row is None else row.period for row in rows],
            phase=[0.0 if row is None else row.phase for row in rows],
        )

    return tuple(located(axes, partial(harmonic, k), "cogging", k) for k in range(count))


def _rigid(axes: Axes) -> Dynamics:
    return located(
        axes,
        lambda some: RigidAxes(
            mass=[axis.mass or 0.0 for axis in some],
            viscous=[axis.viscous for axis in some],
            gain=[axis.gain for axis in some],
            friction=_friction(some), cogging=_cogging(some),
        ),
    )  # fmt: skip


def _transfer_function(axes: Axes) -> Dynamics:
    return located(
        axes,
        lambda some: TransferFunctionAxes(
            numerators=tuple(axis.numerator or () for axis in some),
            denominators=tuple(axis.denominator or () for axis in some),
        ),
    )


def _two_mass(axes: Axes) -> Dynamics:
    return located(axes, _two_mass_of, "two_mass")


def _two_mass_of(axes: Axes) -> Dynamics:
    names = ("motor_mass", "load_mass", "stiffness", "damping", "motor_viscous", "load_viscous",
             "gain")  # fmt: skip
    ones: list[dict[str, Any]] = []
    for axis in axes:
        own = axis.two_mass
        assert own is not None
        common: dict[str, Any] = {
            name: getattr(own, name) for name in ("motor_viscous", "load_viscous", "gain")
        }
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
    return TwoMassAxes(
        **{name: [one[name] for one in ones] for name in names},
        motor_friction=_friction(axes, "two_mass", "motor_friction"),
        load_friction=_friction(axes),
        backlash=_filled([p.backlash if p else None for p in parts], 0.0),
        cogging=_cogging(axes),
    )


def _ball_screw(axes: Axes) -> Dynamics:
    return located(axes, _ball_screw_of, "ball_screw")


def _ball_screw_of(axes: Axes) -> Dynamics:
    parts = [axis.ball_screw for axis in axes]

    def column(name: str) -> list[Any]:
        return [getattr(part, name) for part in parts]

    return_all = {
        field: all_or_none(axes, f"ball_screw.{key}", column(key))
        for field, key in (
            ("torque_constant", "torque_constant_n_m_per_a"),
            ("stiffness", "stiffness_n_per_m"),
            ("damping_ratio", "damping_ratio"),
        )
    }
    return BallScrewAxes(
        lead=column("lead"), motor_inertia=column("motor_inertia_kg_m2"),
        screw_inertia=column("screw_inertia_kg_m2"), table_mass=column("table_mass_kg"),
        motor_viscous=column("motor_viscous_n_m_s"),
        table_viscous=column("table_viscous_n_s_per_m"),
        amplifier_gain=_filled(column("amplifier_gain_a_per_v"), 1.0),
        backlash=_filled(column("backlash"), 0.0),
        motor_friction=_friction(axes, "ball_screw", "motor_friction"),
        table_friction=_friction(axes), cogging=_cogging(axes), **return_all,
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

    Raises
    ------
    KeyedError
        A side or an error of a scale that would change nothing.
    """
    for k, axis in enumerate(section.axis or []):
        _check_sides(k, axis)
    return located(section.axis or [], lambda some: _encoder(section, some))


def _check_sides(k: int, axis: AxisSection) -> None:
    sides = {"measured": axis.measured, "velocity_measured": axis.velocity_measured}
    scale = axis.scale_error or PositionErrorSection()
    shown = "tool" in (axis.measured, axis.velocity_measured)
    if (scale.scale or scale.amplitude) and not shown:
        raise KeyedError(
            ("machine", "axis", k, "scale_error"),
            f"axis {axis.name}: scale_error is of a linear scale, which an axis with measured = "
            '"motor" does not have; give measured = "tool" or remove it',
        )
    one_side = axis.screw_error is None and not (axis.scale_error and shown)
    if axis.kind == "mass" and one_side:
        for name, side in sides.items():
            if side == "motor":
                raise KeyedError(
                    ("machine", "axis", k, name),
                    f'axis {axis.name}: {name} = "motor" changes nothing on a rigid axis without '
                    "screw_error; give screw_error, two_mass or ball_screw, or remove it",
                )


def _encoder(section: MachineSection, axes: Axes) -> Encoder:
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
        return located(axes, partial(_position_error, name), name)

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


def _position_error(name: str, axes: Axes) -> PositionError:
    rows = [getattr(axis, name) or PositionErrorSection() for axis in axes]
    return PositionError(
        scale=[row.scale for row in rows],
        amplitude=[row.amplitude for row in rows],
        period=[1.0 if row.period is None else row.period for row in rows],
        phase=[row.phase for row in rows],
    )


def nominal_of(section: MachineSection) -> NominalModel | None:
    """Return what laws are told instead of the truth, None if it is not given.

    Parameters
    ----------
    section
        ``[machine]``, with axes.
    """
    axes = section.axis or []
    if all_or_none(axes, "nominal", [axis.nominal for axis in axes]) is None:
        return None
    return located(axes, lambda some: _nominal(section.command, some), "nominal")


def _nominal(command: Any, axes: Axes) -> NominalModel:
    rows: list[Any] = [axis.nominal for axis in axes]
    stiff = any(row.stiffness is not None for row in rows)
    return NominalModel(
        mass=np.array([row.mass for row in rows]),
        viscous=np.array([row.viscous for row in rows]),
        coulomb=np.array([row.coulomb for row in rows]),
        gain=np.array([row.gain for row in rows]),
        command_limit=np.array(
            [math.inf if row.command_limit is None else row.command_limit for row in rows]
        ),
        command=command,
        stiffness=np.array([row.stiffness or 0.0 for row in rows]) if stiff else None,
    )
