"""Ball screws with their motors, in the numbers of their data sheets.

The screw turns with the motor and moves the nut by its lead p per revolution, so with r = p / 2π

    M_m = (J_motor + J_screw) / r²     B_m = b / r²     F_m = torque / r     K = K_t K_a / r

and the table is the load. With a stiffness (screw, nut and bearings in series) the axes are
:class:`TwoMassAxes`; without one they are :class:`RigidAxes` with the inertia reflected. The fields
stay those of the data sheet, so that a study can vary a lead or an inertia.

Sources of the formulae: rigid-body kinematics. The page on data sheets in ``docs`` says where each
number stands and how to measure those that no sheet gives.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from contourlab.configuration import is_concrete, part, real
from contourlab.errors import ConfigurationError
from contourlab.machines.base import (
    BoundDynamics,
    Dynamics,
    LinearModel,
    NominalModel,
    PerAxis,
    per_axis,
)
from contourlab.machines.cogging import Cogging
from contourlab.machines.drive import Drive
from contourlab.machines.friction import Friction
from contourlab.machines.rigid import RigidAxes
from contourlab.machines.two_mass import TwoMassAxes
from contourlab.typing import Scalar

__all__ = ["BallScrewAxes"]


class BallScrewAxes(Dynamics):
    """Motor and ball screw per axis; a single number holds for every axis.

    The effort is the force at the table in N. Dynamics of the current loop are left out.
    """

    lead: PerAxis = real(unit="m", above=0.0, ndim=1)
    """p, travel per revolution, also called pitch on single-start screws [m]."""
    motor_inertia: PerAxis = real(minimum=0.0, ndim=1)
    """Rotor, with brake if there is one [kg m²]."""
    screw_inertia: PerAxis = real(minimum=0.0, ndim=1, default=0.0)
    """Screw and coupling [kg m²]."""
    table_mass: PerAxis = real(minimum=0.0, ndim=1)
    """Table, nut, and what it carries [kg]."""
    motor_viscous: PerAxis = real(minimum=0.0, ndim=1, default=0.0)
    """b, of everything that turns [N m s/rad]."""
    table_viscous: PerAxis = real(minimum=0.0, ndim=1, default=0.0)
    """Of the guides [N s/m]."""
    torque_constant: PerAxis | None = real(above=0.0, ndim=1, default=None)
    """K_t [N m/A], or [N m/V] with the amplifier in it; not given: the command is the force [N]."""
    amplifier_gain: PerAxis | None = real(above=0.0, ndim=1, default=None)
    """K_a, current per unit of command [A/V]; 1 if not given. Goes with ``torque_constant``."""
    stiffness: PerAxis | None = real(above=0.0, ndim=1, default=None)
    """Between motor and table, in the direction of travel [N/m]; not given: rigid."""
    damping_ratio: PerAxis | None = real(minimum=0.0, ndim=1, default=None)
    """Of the free resonance, 0.01 to 0.1 on machine tools; goes with ``stiffness``."""
    motor_friction: Friction | None = part(default=None)
    """Dry friction of motor, bearings and preloaded nut: levels in N m, speeds in m/s of travel."""
    table_friction: Friction | None = part(default=None)
    """Dry friction of guides and wipers: levels in N."""
    backlash: PerAxis | None = real(unit="m", minimum=0.0, ndim=1, default=None)
    """The whole free travel between screw and nut [m]; goes with ``stiffness``."""
    cogging: tuple[Cogging, ...] = part(default=())
    """Harmonics of the motor's cogging, as forces at the table [N] over travel [m]."""

    def check(self) -> None:
        """Check that what belongs to a flexible screw is given with its stiffness."""
        if self.stiffness is None:
            for name in ("damping_ratio", "backlash"):
                if getattr(self, name) is not None:
                    raise ConfigurationError(
                        f"{name} goes with stiffness, which is not given: a rigid screw has only "
                        "one side"
                    )
            moved = self.motor_inertia + self.screw_inertia + self.table_mass  # type: ignore[operator]
            if np.any(np.asarray(moved) <= 0.0):
                raise ConfigurationError("motor_inertia and table_mass must not all be zero")
            self._one_friction()
        else:
            if self.damping_ratio is None:
                raise ConfigurationError(
                    "stiffness needs damping_ratio, of the resonance that it makes"
                )
            turned = self.motor_inertia + self.screw_inertia  # type: ignore[operator]
            for name, value in (("motor_inertia", turned), ("table_mass", self.table_mass)):
                if np.any(np.asarray(value) <= 0.0):
                    raise ConfigurationError(f"{name} must be > 0 with a stiffness, got {value}")
        if self.amplifier_gain is not None and self.torque_constant is None:
            raise ConfigurationError("amplifier_gain goes with torque_constant, which is not given")

    @property
    def translated(self) -> RigidAxes | TwoMassAxes:
        """The same axes in travel: two masses, or one where the screw is rigid."""
        radius: Any = self.lead / (2.0 * math.pi)  # type: ignore[operator]
        turning = (self.motor_inertia + self.screw_inertia) / radius**2  # type: ignore[operator]
        viscous = self.motor_viscous / radius**2
        gain: Any = 1.0
        if self.torque_constant is not None:
            amplifier: Any = 1.0 if self.amplifier_gain is None else self.amplifier_gain
            gain = self.torque_constant * amplifier / radius
        if self.stiffness is None:
            return RigidAxes(
                mass=turning + self.table_mass, viscous=viscous + self.table_viscous, gain=gain,
                friction=self._one_friction(), cogging=self.cogging,
            )  # fmt: skip
        reduced = turning * self.table_mass / (turning + self.table_mass)
        # at rest the square root is of positive numbers: the check has seen to it
        damping = 2.0 * self.damping_ratio * (self.stiffness * reduced) ** 0.5  # type: ignore[operator]
        motor = self.motor_friction
        return TwoMassAxes(
            motor_mass=turning, load_mass=self.table_mass, stiffness=self.stiffness,
            damping=damping, motor_viscous=viscous, load_viscous=self.table_viscous, gain=gain,
            motor_friction=None if motor is None else motor.scaled(1.0 / radius),
            load_friction=self.table_friction, backlash=self.backlash, cogging=self.cogging,
        )  # fmt: skip

    def _one_friction(self) -> Friction | None:
        """The friction of a rigid screw: that of the motor in N and that of the table together."""
        motor, table = self.motor_friction, self.table_friction
        if motor is None:
            return table
        motor = motor.scaled(2.0 * math.pi / self.lead)  # type: ignore[operator]
        if table is None:
            return motor
        for name in ("stribeck_velocity", "smoothing_velocity"):
            one, other = getattr(motor, name), getattr(table, name)
            if is_concrete(one) and is_concrete(other) and not np.all(one == other):
                raise ConfigurationError(
                    f"{name} must be the same for motor_friction and table_friction on a rigid "
                    f"screw, got {one} and {other} m/s"
                )

        def level(friction: Friction, name: str) -> Any:
            value = getattr(friction, name)
            return friction.coulomb if value is None else value

        levels = {
            name: level(motor, name) + level(table, name)
            for name in ("breakaway", "coulomb_backward")
            if getattr(motor, name) is not None or getattr(table, name) is not None
        }
        if "breakaway" in levels:  # one without it breaks away at its larger Coulomb level
            levels["breakaway"] = sum(_breakaway(f) for f in (motor, table))
        return Friction(
            coulomb=motor.coulomb + table.coulomb,  # type: ignore[operator]
            stribeck_velocity=table.stribeck_velocity,
            smoothing_velocity=table.smoothing_velocity, **levels,
        )  # fmt: skip

    @property
    def uses_substeps(self) -> bool:
        """Whether there is dry friction, backlash or cogging."""
        return self.translated.uses_substeps

    def check_axes(self, n_axes: int) -> None:
        """Check that every field has one value per axis or one for all.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        for name in (
            "lead", "motor_inertia", "screw_inertia", "table_mass", "motor_viscous",
            "table_viscous", "torque_constant", "amplifier_gain", "stiffness", "damping_ratio",
            "backlash",
        ):  # fmt: skip
            if getattr(self, name) is not None:
                per_axis(name, getattr(self, name), n_axes)
        for side in ("motor_friction", "table_friction"):
            if getattr(self, side) is not None:
                getattr(self, side).check_axes(n_axes, side)
        for harmonic in self.cogging:
            harmonic.check_axes(n_axes)

    def bind(self, n_axes: int, durations: tuple[Scalar, ...], substeps: int) -> BoundDynamics:
        """Return the axes for intervals of known length.

        Parameters
        ----------
        n_axes
            Number of axes.
        durations
            Length of each part of a control period over which the command is constant [s].
        substeps
            Substeps per control period; used with dry friction, backlash or cogging only.
        """
        return self.translated.bind(n_axes, durations, substeps)

    def nominal(self, n_axes: int, drive: Drive) -> NominalModel:
        """Return the rigid body with the inertia reflected to the table.

        Parameters
        ----------
        n_axes
            Number of axes.
        drive
            Kind and limit of the command.
        """
        return self.translated.nominal(n_axes, drive)

    def linear(self, n_axes: int) -> LinearModel:
        """Return the linear part; dry friction, backlash and cogging left out.

        Parameters
        ----------
        n_axes
            Number of axes.
        """
        return self.translated.linear(n_axes)


def _breakaway(friction: Friction) -> Any:
    if friction.breakaway is not None:
        return friction.breakaway
    if friction.coulomb_backward is None:
        return friction.coulomb
    one, other = friction.coulomb, friction.coulomb_backward
    return 0.5 * (one + other + abs(one - other))  # type: ignore[operator]
