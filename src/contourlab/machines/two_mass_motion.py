"""How two masses on a spring move: exactly where they are linear, in substeps where not.

Without dry friction, cogging and backlash the motion over an interval is a matrix exponential,
exact at the sampling instants. With one of them, the interval is cut into substeps. In each,
friction is its secant (see :mod:`contourlab.machines.rigid`), contact is open or closed, cogging is
a number: all three frozen at a midpoint that half a step of backward Euler predicts. The linear
equation that is left, two masses with a spring, is advanced by the (2, 3) Padé approximant of its
exponential, in partial fractions, so that each fraction is one 2 × 2 solve without cancellation.

The rule is of second order in friction, backlash and cogging. Its linear part is of fifth order and
strongly damped at infinity (L-stable): no substep is too long for a stiff spring or for the steep
slope of friction at rest. A mode of 1 kHz at substeps of 0.1 ms is off by 9e-6 per substep, one of
100 Hz by 1e-11. Its fixed points are the true ones, and momentum is kept to rounding.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import is_concrete
from contourlab.errors import ConfigurationError
from contourlab.machines.base import BoundDynamics
from contourlab.machines.cogging import BoundCogging
from contourlab.machines.exponential import LARGEST_NORM, exponential
from contourlab.machines.friction import BoundFriction
from contourlab.typing import Array, AxisVector

__all__ = ["NUMBERS", "BoundTwoMassAxes", "TwoMassState", "exact", "matrices"]

NUMBERS = ("motor_mass", "load_mass", "stiffness", "damping", "motor_viscous", "load_viscous",
           "gain")  # fmt: skip
"""Fields of the configuration that are one number per axis."""


class TwoMassState(eqx.Module):
    """True motion of both sides, in travel of the axis."""

    position: AxisVector
    """Of the load [m]."""
    stretch: AxisVector
    """δ, motor minus load [m]."""
    velocity: AxisVector
    """Of the load [m/s]."""
    motor_velocity: AxisVector
    """[m/s]"""


def matrices(numbers: Any, omega: Any) -> tuple[Array, Array]:
    """Return A (n_axes, 4, 4) and B (n_axes, 4, 2) for states (q_l, ω δ, v_l, v_m).

    Inputs are the command and the effort on the load.

    Parameters
    ----------
    numbers
        By name, shape (n_axes,) each.
    omega
        Scale ω of the stretch, shape (n_axes,) [rad/s].
    """
    motor, load, k, c, b_m, b_l, gain = (jnp.asarray(numbers[name]) for name in NUMBERS)
    none, one, spring = jnp.zeros_like(motor), jnp.ones_like(motor), k / omega
    a = jnp.stack([
        jnp.stack([none, none, one, none], -1),
        jnp.stack([none, none, -omega * one, omega * one], -1),
        jnp.stack([none, spring / load, -(c + b_l) / load, c / load], -1),
        jnp.stack([none, -spring / motor, c / motor, -(c + b_m) / motor], -1),
    ], -2)  # fmt: skip
    b = jnp.stack([
        jnp.stack([none, none], -1), jnp.stack([none, none], -1),
        jnp.stack([none, 1.0 / load], -1), jnp.stack([gain / motor, none], -1),
    ], -2)  # fmt: skip
    return a, b


def exact(lengths: Array, numbers: Any) -> tuple[Array, Array]:
    """Return exp(A h), (n_parts, n_axes, 4, 4), and ∫ exp(A t) B dt, of the linear axes.

    Parameters
    ----------
    lengths
        h, shape (n_parts,) [s].
    numbers
        By name, shape (n_axes,) each.

    Raises
    ------
    ConfigurationError
        A resonance far too fast for the exact solution.
    """
    motor, load, k = (numbers[name] for name in ("motor_mass", "load_mass", "stiffness"))
    # scaled so that no entry is far larger than the frequencies; the scale leaves again below
    omega = jax.lax.stop_gradient(jnp.sqrt(jnp.asarray(k * (1.0 / motor + 1.0 / load))))
    a, b = matrices(numbers, omega)
    norm = jnp.max(lengths) * jnp.max(jnp.sum(jnp.abs(a), -1))
    if is_concrete(norm) and not norm <= LARGEST_NORM:
        raise ConfigurationError(
            "the axes are too fast for the sample time: resonance [rad/s] and viscous friction "
            f"over mass, times sample time, must stay below {LARGEST_NORM:g}, got "
            f"{float(norm):g}; leave the stiffness out (RigidAxes) or the light mass"
        )
    block = jnp.concatenate([a, b], -1)
    block = jnp.concatenate([block, jnp.zeros((*block.shape[:-2], 2, 6))], -2)
    whole = jax.jit(exponential)(lengths[:, None, None, None] * block)[..., :4, :]
    rows = jnp.ones((*omega.shape, 4)).at[..., 1].set(1.0 / omega)
    whole = whole * rows[..., :, None]
    columns = jnp.ones((*omega.shape, 4)).at[..., 1].set(omega)
    return whole[..., :4] * columns[..., None, :], whole[..., 4:]


# Partial fractions of φ₂ of the (2, 3) Padé approximant R of exp, φ₂ = (R - 1 - z) / z²:
# (1/2 - 2z/15 + z²/60) / (1 - 3z/5 + 3z²/20 - z³/60) = Σ weight / (1 - z / pole)
_POLES = np.roots([-1.0 / 60.0, 3.0 / 20.0, -3.0 / 5.0, 1.0])
_REAL, _PAIR = (int(np.argmin(np.abs(_POLES.imag))), int(np.argmax(_POLES.imag)))
_WEIGHTS = [
    (0.5 - 2.0 * p / 15.0 + p * p / 60.0)
    / np.prod([1.0 - p / other for other in np.delete(_POLES, k)])
    for k, p in enumerate(_POLES)
]
_REAL_STEP, _REAL_WEIGHT = float(1.0 / _POLES[_REAL].real), float(_WEIGHTS[_REAL].real)
_PAIR_STEP, _PAIR_WEIGHT = complex(1.0 / _POLES[_PAIR]), complex(2.0 * _WEIGHTS[_PAIR])


class _Frozen(eqx.Module):
    """The linear equation of one substep: (M, D) of both sides, contact and constant efforts."""

    motor_mass: Array
    load_mass: Array
    motor_damping: Array
    load_damping: Array
    stiffness: Array
    damping: Array
    motor_effort: Array
    """K u + F_c + k g/2 side: all that is constant on the motor side."""
    load_effort: Array

    def rate(self, stretch: Array, load: Array, motor: Array) -> tuple[Array, Array, Array]:
        """Derivative of stretch, load velocity and motor velocity."""
        through = self.stiffness * stretch + self.damping * (motor - load)
        return (
            motor - load,
            (self.load_effort - self.load_damping * load + through) / self.load_mass,
            (self.motor_effort - self.motor_damping * motor - through) / self.motor_mass,
        )

    def resolve(self, g: Any, rate: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        """Solve (I - g A) x = rate: no subtraction of what is positive for g > 0."""
        r_stretch, r_load, r_motor = rate
        pull = g * self.stiffness * r_stretch
        joint = g * (self.damping + g * self.stiffness)
        load = self.load_mass + g * self.load_damping
        motor = self.motor_mass + g * self.motor_damping
        on_load = self.load_mass * r_load + pull
        on_motor = self.motor_mass * r_motor - pull
        inverse = 1.0 / (load * motor + joint * (load + motor))
        x_load = ((motor + joint) * on_load + joint * on_motor) * inverse
        x_motor = ((load + joint) * on_motor + joint * on_load) * inverse
        # their difference, from what does not cancel when the spring is stiff
        return r_stretch + g * (load * on_motor - motor * on_load) * inverse, x_load, x_motor

    def mean(
        self, h: Array, y: tuple[Array, Array, Array], rate: tuple[Array, Array, Array]
    ) -> tuple[Array, Array, Array]:
        """Mean of the state y over a time h: y + h φ₂(h A) rate."""
        one, two = self.resolve(_REAL_STEP * h, rate), self.resolve_pair(h, rate)
        s, v, w = (x + h * (_REAL_WEIGHT * p + q) for x, p, q in zip(y, one, two, strict=True))
        return s, v, w

    def resolve_pair(
        self, h: Array, rate: tuple[Array, Array, Array]
    ) -> tuple[Array, Array, Array]:
        """Real part of weight × (I - g A)⁻¹ rate, for the pair of complex poles.

        As ``resolve``, in real numbers: ``_i`` are imaginary parts. Complex ones are slower, and
        generated code would have to know them.
        """
        r_stretch, r_load, r_motor = rate
        g, g_i = _PAIR_STEP.real * h, _PAIR_STEP.imag * h
        pull, pull_i = g * self.stiffness * r_stretch, g_i * self.stiffness * r_stretch
        inner, inner_i = self.damping + g * self.stiffness, g_i * self.stiffness
        joint, joint_i = g * inner - g_i * inner_i, g * inner_i + g_i * inner
        load, load_i = self.load_mass + g * self.load_damping, g_i * self.load_damping
        motor, motor_i = self.motor_mass + g * self.motor_damping, g_i * self.motor_damping
        on_load, on_motor = self.load_mass * r_load, self.motor_mass * r_motor
        push = on_load + on_motor  # what the spring hands over cancels
        on_load, on_motor = on_load + pull, on_motor - pull
        both, both_i = load + motor, load_i + motor_i
        det = load * motor - load_i * motor_i + joint * both - joint_i * both_i
        det_i = load * motor_i + load_i * motor + joint * both_i + joint_i * both
        inverse = 1.0 / (det * det + det_i * det_i)
        a, a_i = _PAIR_WEIGHT.real, _PAIR_WEIGHT.imag
        weight, weight_i = (a * det + a_i * det_i) * inverse, (a_i * det - a * det_i) * inverse
        own_load = motor * on_load - motor_i * pull_i
        own_load_i = motor * pull_i + motor_i * on_load
        own_motor = load * on_motor + load_i * pull_i
        own_motor_i = load_i * on_motor - load * pull_i
        apart, apart_i = own_motor - own_load, own_motor_i - own_load_i
        common, common_i = joint * push, joint_i * push
        return (
            a * r_stretch
            + weight * (g * apart - g_i * apart_i)
            - weight_i * (g * apart_i + g_i * apart),
            weight * (own_load + common) - weight_i * (own_load_i + common_i),
            weight * (own_motor + common) - weight_i * (own_motor_i + common_i),
        )


class BoundTwoMassAxes(BoundDynamics):
    """Two masses per axis for one sample time."""

    motor_mass: AxisVector
    load_mass: AxisVector
    stiffness: AxisVector
    damping: AxisVector
    motor_viscous: AxisVector
    load_viscous: AxisVector
    gain: AxisVector
    motor_friction: BoundFriction | None
    load_friction: BoundFriction | None
    half_gap: AxisVector | None
    cogging: BoundCogging | None
    step: Float[Array, " n_parts"]
    """Length of a substep [s]."""
    held: tuple[Float[Array, "n_parts n_axes 4 4"], Float[Array, "n_parts n_axes 4 2"]] | None
    """Exact transition and input, where nothing needs substeps."""
    counts: tuple[int, ...] = eqx.field(static=True)
    """Substeps of each part."""

    def steady(self, position: AxisVector, velocity: AxisVector) -> tuple[TwoMassState, AxisVector]:
        """Return the state in steady motion and the command that keeps it.

        In motion the spring carries the friction of the load. At rest no force passes and the motor
        stands in the middle of the backlash.

        Parameters
        ----------
        position
            Of the load, shape (n_axes,) [m].
        velocity
            Shape (n_axes,) [m/s].
        """
        through = self._drag(self.load_friction, self.load_viscous, velocity) * velocity
        stretch = through / self.stiffness
        if self.half_gap is not None:
            stretch = stretch + jnp.sign(through) * self.half_gap
        effort = self._drag(self.motor_friction, self.motor_viscous, velocity) * velocity + through
        if self.cogging is not None:  # what holds the motor at this place
            effort = effort - self.cogging.effort(position + stretch)
        return TwoMassState(position, stretch, velocity, velocity), effort / self.gain

    def advance(
        self, state: TwoMassState, commands: tuple[AxisVector, ...], disturbance: AxisVector
    ) -> TwoMassState:
        """Return the state one control period later.

        Parameters
        ----------
        state
            Motion at its start.
        commands
            One per part of the period, shape (n_axes,) each.
        disturbance
            Effort on the load over the whole period, shape (n_axes,).
        """
        for row, command in enumerate(commands):
            if self.held is not None:
                state = self._held(state, command, disturbance, row)
            else:
                effort = self.gain * command
                state = self._slide(state, effort, disturbance, self.step[row], self.counts[row])
        return state

    def _held(
        self, state: TwoMassState, command: AxisVector, disturbance: AxisVector, row: int
    ) -> TwoMassState:
        assert self.held is not None
        # products and sums: XLA fuses these, while a small matrix product is a call
        before = jnp.stack(
            [state.position, state.stretch, state.velocity, state.motor_velocity], -1
        )
        inputs = jnp.stack([command, disturbance], -1)
        after = jnp.sum(self.held[0][row] * before[:, None, :], -1)
        after = after + jnp.sum(self.held[1][row] * inputs[:, None, :], -1)
        return TwoMassState(after[:, 0], after[:, 1], after[:, 2], after[:, 3])

    @staticmethod
    def _drag(friction: BoundFriction | None, viscous: Array, velocity: Array) -> Array:
        return viscous if friction is None else viscous + friction.secant(velocity)

    def _frozen(
        self, stretch: Array, load: Array, motor: Array, effort: Array, disturbance: Array
    ) -> _Frozen:
        stiffness, damping = self.stiffness, self.damping
        if self.half_gap is not None:
            size = jnp.abs(stretch)
            open_gap = size < self.half_gap
            share = 1.0 - self.half_gap / jnp.where(size > 0.0, size, 1.0)
            share = jnp.where(size > 0.0, share, 1.0)
            offset = jnp.sign(stretch) * self.half_gap * stiffness
            offset = jnp.where(open_gap, 0.0, offset)
            stiffness = jnp.where(open_gap, 0.0, stiffness)
            damping = jnp.where(open_gap, 0.0, damping * share)
            effort, disturbance = effort + offset, disturbance - offset
        on_motor = self._drag(self.motor_friction, self.motor_viscous, motor)
        on_load = self._drag(self.load_friction, self.load_viscous, load)
        return _Frozen(
            self.motor_mass, self.load_mass, on_motor, on_load, stiffness, damping, effort,
            disturbance,
        )  # fmt: skip

    def _slide(
        self, state: TwoMassState, effort: AxisVector, disturbance: AxisVector, h: Array, count: int
    ) -> TwoMassState:
        half = 0.5 * h

        def substep(now: TwoMassState, _: None) -> tuple[TwoMassState, None]:
            s, v, w = now.stretch, now.velocity, now.motor_velocity
            push = effort
            if self.cogging is not None:
                push = effort + self.cogging.effort(now.position + s + half * w)
            frozen = self._frozen(s, v, w, push, disturbance)
            ds, dv, dw = frozen.resolve(half, frozen.rate(s, v, w))
            frozen = self._frozen(s + half * ds, v + half * dv, w + half * dw, push, disturbance)
            rate = frozen.rate(s, v, w)
            # the mean state over the substep gives the end: each moves by h (A mean + b)
            mean_s, mean_v, mean_w = frozen.mean(h, (s, v, w), rate)
            ds, dv, dw = frozen.rate(mean_s, mean_v, mean_w)
            after = TwoMassState(now.position + h * mean_v, s + h * ds, v + h * dv, w + h * dw)
            return after, None

        return jax.lax.scan(substep, state, None, length=count)[0]

    def position(self, state: TwoMassState) -> AxisVector:
        """Return the true positions of the load [m].

        Parameters
        ----------
        state
            Motion of the axes.
        """
        return state.position

    def velocity(self, state: TwoMassState) -> AxisVector:
        """Return the true velocities of the load [m/s].

        Parameters
        ----------
        state
            Motion of the axes.
        """
        return state.velocity

    def motor_position(self, state: TwoMassState) -> AxisVector:
        """Return the positions of the motors, in travel of the axis [m].

        Parameters
        ----------
        state
            Motion of the axes.
        """
        return state.position + state.stretch

    def motor_velocity(self, state: TwoMassState) -> AxisVector:
        """Return the velocities of the motors, in travel of the axis [m/s].

        Parameters
        ----------
        state
            Motion of the axes.
        """
        return state.motor_velocity
