"""Two masses per axis, joined by a spring, a damper and, if given, a backlash.

    M_m q_m'' + B_m q_m' + F_m(q_m') = K u + F_c(q_m) - T      (motor side)
    M_l q_l'' + B_l q_l' + F_l(q_l') = d + T                   (load side: table and tool)

    δ = q_m - q_l      T = k (δ - g/2 sign δ) + c (1 - g / 2|δ|) δ'  where |δ| > g/2, else 0

Everything is in travel of the axis: for a screw, the motor's angle times lead / 2π. The first
structural mode of a feed drive is such a pair, whether the spring is a screw with its nut and
bearings, a belt, or the frame under a linear motor; :class:`BallScrewAxes` makes one from a data
sheet. Where the pair is met by the field's two frequencies: with the motor held, the load swings at
the anti-resonance √(k / M_l); free, both swing at the resonance √(k (1/M_m + 1/M_l)).

The backlash g is the whole free travel. No force passes in the gap. The damper fades in with the
contact, so that T has no jump: an impact does not stick.

A disturbance acts on the load side, as a cutting force does.
"""

from __future__ import annotations

import math
from typing import Any

import jax
import numpy as np

from contourlab.configuration import is_concrete, part, real
from contourlab.errors import ConfigurationError
from contourlab.machines.base import Dynamics, LinearModel, NominalModel, PerAxis, per_axis
from contourlab.machines.cogging import Cogging, bind_cogging
from contourlab.machines.drive import Drive
from contourlab.machines.friction import Friction
from contourlab.machines.substeps import lengths_of, share
from contourlab.machines.two_mass_motion import NUMBERS, BoundTwoMassAxes, exact, matrices
from contourlab.typing import Array, Scalar

__all__ = ["TwoMassAxes"]


class TwoMassAxes(Dynamics):
    """Axes of two masses each. A single number holds for every axis; *effort* as in RigidAxes."""

    motor_mass: PerAxis = real(above=0.0, ndim=1)
    """M_m [effort per m/s²]."""
    load_mass: PerAxis = real(above=0.0, ndim=1)
    """M_l [effort per m/s²]."""
    stiffness: PerAxis = real(above=0.0, ndim=1)
    """k [effort per m]."""
    damping: PerAxis = real(minimum=0.0, ndim=1, default=0.0)
    """c, between the masses [effort per m/s]."""
    motor_viscous: PerAxis = real(minimum=0.0, ndim=1, default=0.0)
    """B_m, to ground [effort per m/s]."""
    load_viscous: PerAxis = real(minimum=0.0, ndim=1, default=0.0)
    """B_l, to ground [effort per m/s]."""
    gain: PerAxis = real(above=0.0, ndim=1, default=1.0)
    """K [effort per unit of command]."""
    motor_friction: Friction | None = part(default=None)
    """Dry friction of motor, bearings and seals; none if not given."""
    load_friction: Friction | None = part(default=None)
    """Dry friction of the guides; none if not given."""
    backlash: PerAxis | None = real(unit="m", minimum=0.0, ndim=1, default=None)
    """g, the whole free travel between motor and load [m]; none if not given."""
    cogging: tuple[Cogging, ...] = part(default=())
    """Harmonics of the motor's cogging."""

    @classmethod
    def by_frequency(
        cls, *, mass: PerAxis, mass_ratio: PerAxis, anti_resonance_hz: PerAxis,
        damping_ratio: PerAxis, **others: Any,
    ) -> TwoMassAxes:  # fmt: skip
        """Return axes from what a frequency response shows.

        Parameters
        ----------
        mass
            Both sides together, > 0 [effort per m/s²].
        mass_ratio
            Load over motor side, > 0; (resonance / anti-resonance)² - 1.
        anti_resonance_hz
            Where the motor side hardly moves, > 0 [Hz].
        damping_ratio
            Of the free resonance, >= 0.
        **others
            Other fields of the class.

        Raises
        ------
        ConfigurationError
            A number out of bounds.
        """
        given = {"mass": mass, "mass_ratio": mass_ratio, "anti_resonance_hz": anti_resonance_hz}
        for name, value in given.items():
            if is_concrete(value) and not np.all(np.asarray(value) > 0.0):
                raise ConfigurationError(f"{name} must be > 0, got {value}")
        if is_concrete(damping_ratio) and not np.all(np.asarray(damping_ratio) >= 0.0):
            raise ConfigurationError(f"damping_ratio must be >= 0, got {damping_ratio}")
        total, ratio, anti, zeta = (
            value if isinstance(value, jax.Array) else np.asarray(value, np.float64)
            for value in (mass, mass_ratio, anti_resonance_hz, damping_ratio)
        )
        motor, load = total / (1.0 + ratio), total * ratio / (1.0 + ratio)
        stiffness = load * (2.0 * math.pi * anti) ** 2
        reduced = motor * ratio / (1.0 + ratio)  # 1 / (1/M_m + 1/M_l)
        damping = 2.0 * zeta * (stiffness * reduced) ** 0.5
        return cls(motor_mass=motor, load_mass=load, stiffness=stiffness, damping=damping, **others)

    @property
    def anti_resonance_hz(self) -> Array:
        """√(k / M_l) / 2π [Hz]: the load on its spring while the motor is held."""
        stiffness: Any = self.stiffness
        return _leaf((stiffness / self.load_mass) ** 0.5 / (2.0 * math.pi))

    @property
    def resonance_hz(self) -> Array:
        """√(k (1/M_m + 1/M_l)) / 2π [Hz]: both against each other, undamped."""
        return _leaf((self.stiffness / self._reduced) ** 0.5 / (2.0 * math.pi))

    @property
    def damping_ratio(self) -> Array:
        """Of the free resonance, c / (2 √(k μ)), with μ the reduced mass; B_m and B_l left out."""
        damping: Any = self.damping
        return _leaf(0.5 * damping / (self.stiffness * self._reduced) ** 0.5)

    @property
    def _reduced(self) -> Any:
        motor, load = self.motor_mass, self.load_mass
        return motor * load / (motor + load)  # type: ignore[operator]

    @property
    def uses_substeps(self) -> bool:
        """Whether there is dry friction, backlash or cogging."""
        rough = (self.motor_friction, self.load_friction, self.backlash)
        return any(item is not None for item in rough) or bool(self.cogging)

    def check_axes(self, n_axes: int) -> None:
        """Check that every field has one value per axis or one for all.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        for name in NUMBERS:
            per_axis(name, getattr(self, name), n_axes)
        if self.backlash is not None:
            per_axis("backlash", self.backlash, n_axes)
        for side in ("motor_friction", "load_friction"):
            if getattr(self, side) is not None:
                getattr(self, side).check_axes(n_axes, side)
        for harmonic in self.cogging:
            harmonic.check_axes(n_axes)

    def bind(self, n_axes: int, durations: tuple[Scalar, ...], substeps: int) -> BoundTwoMassAxes:
        """Return the axes for intervals of known length.

        Parameters
        ----------
        n_axes
            Number of axes.
        durations
            Length of each part of a control period over which the command is constant [s].
        substeps
            Substeps per control period, shared between the parts; used with dry friction, backlash
            or cogging only.

        Raises
        ------
        ConfigurationError
            A resonance far too fast for the exact solution.
        """
        numbers = {name: per_axis(name, getattr(self, name), n_axes) for name in NUMBERS}
        ones = np.ones(n_axes)
        motor, load = (
            None if friction is None else friction.bind(ones)
            for friction in (self.motor_friction, self.load_friction)
        )
        gap = None if self.backlash is None else 0.5 * per_axis("backlash", self.backlash, n_axes)
        uses = self.uses_substeps
        counts = share(substeps, durations) if uses else (1,) * len(durations)
        lengths = lengths_of(durations, counts)
        held = None if uses else exact(lengths, numbers)
        return BoundTwoMassAxes(
            **numbers, motor_friction=motor, load_friction=load, half_gap=gap,
            cogging=bind_cogging(self.cogging, n_axes), step=lengths, held=held, counts=counts,
        )  # fmt: skip

    def nominal(self, n_axes: int, drive: Drive) -> NominalModel:
        """Return the rigid body that both masses are at low frequency.

        Parameters
        ----------
        n_axes
            Number of axes.
        drive
            Kind and limit of the command.
        """
        coulomb: Any = 0.0
        for friction in (self.motor_friction, self.load_friction):
            if friction is not None:
                coulomb = coulomb + friction.mean_coulomb
        values = {
            "mass": self.motor_mass + self.load_mass,  # type: ignore[operator]
            "viscous": self.motor_viscous + self.load_viscous,  # type: ignore[operator]
            "coulomb": coulomb,
            "gain": self.gain,
            "command_limit": drive.command_limit,
        }
        spread = {name: per_axis(name, value, n_axes) for name, value in values.items()}
        return NominalModel(**spread, command=drive.command)

    def linear(self, n_axes: int) -> LinearModel:
        """Return both masses, spring and dampers; friction, backlash and cogging left out.

        States per axis: load position, stretch, load velocity, motor velocity.

        Parameters
        ----------
        n_axes
            Number of axes.
        """
        numbers = {name: per_axis(name, getattr(self, name), n_axes) for name in NUMBERS}
        a, b = (np.asarray(x) for x in matrices(numbers, np.ones(n_axes)))
        size = 4 * n_axes
        state, drive = np.zeros((size, size)), np.zeros((size, n_axes))
        load, motor = np.zeros((2, n_axes, size))
        for axis in range(n_axes):
            rows = slice(4 * axis, 4 * axis + 4)
            state[rows, rows], drive[rows, axis] = a[axis], b[axis, :, 0]
            load[axis, 4 * axis] = 1.0
            motor[axis, 4 * axis : 4 * axis + 2] = 1.0
        return LinearModel(state, drive, load, motor)


def _leaf(value: Any) -> Array:
    return value if isinstance(value, jax.Array) else np.asarray(value, np.float64)
