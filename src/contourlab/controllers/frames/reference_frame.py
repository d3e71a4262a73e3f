"""The frame of tangent, normal and binormal that rides along a contour with the reference point.

R = [T N B] turns coordinates of the frame into those of the axes. With s the arc length at the
reference point, everything that a law needs of the frame's motion is

    R' = R W,    R'' = R (W W + W')                                                     (1)

    W = [[0, -k_n s', -k_b s'], [k_n s', 0, -ψ'], [k_b s', ψ', 0]],   k_i = r_ss · E_i  (2)

(in the plane without the last row and column), where ' is d/dt, E_i the normal and the binormal,
and ψ' the rate at which they turn about the tangent. Derivatives over arc length are exact, to any
order, and nothing is divided by the speed: a reference that stands still is no special case.

In the plane the normal is the tangent turned by +90° and the curvature is signed: no point of a
smooth curve is singular.

In space the frame is that of Frenet, k_b = 0 and ψ' = τ s', where there is one: where the curvature
is more than 0.01 1/m (a radius below 100 m) and the frame turns about the tangent no faster than
``twist_limit``. Elsewhere, on straight stretches and near inflections, where the principal normal
has no meaning or swings round faster than a loop could follow, the frame is *carried on*: it turns
with the tangent and about it no more (a rotation-minimising frame, by double reflection), the
curvature having two signed components k_n, k_b. Any such frame serves, since (2) is exact for all
of them. When the Frenet frame is good again, or when its normal has jumped (a joint of arcs in
different planes), the carried frame turns back to it: the angle Δ between them and its rate decay
as Δ'' = -2 λ Δ' - λ² Δ with λ = ``return_rate``. So R and R' are continuous wherever the tangent
and the curvature vector are. Normals are told apart by their line, not by their direction: past an
inflection the frame goes on with N = -r_ss / κ if that is nearer, the curvature being signed then.

A frame that starts as Frenet's and never leaves it is Frenet's to rounding.

References
----------
.. [MengLouZhou] (3) to (5) and (19), where R' = -v R G; they assume κ τ ≠ 0 everywhere.

Differences from the paper
--------------------------
The carried frame; derivatives over arc length in place of those over time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, real, static
from contourlab.contours.base import left_normal, unit
from contourlab.contours.frenet import arc_length_derivatives
from contourlab.contours.rotation_minimising import transport_normal
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Derivatives, Scalar

__all__ = ["CarriedState", "FrameMotion", "ReferenceFrame", "path_speed", "turned"]

FLAT = 0.01
"""Curvature below which there is no principal normal worth following [1/m]."""
JUMP = 0.01
"""Angle by which the normal may differ from where it was expected before it has jumped [rad]."""


class FrameMotion(eqx.Module):
    """The frame at one instant, and how it moves."""

    rotation: Float[Array, "n_axes n_axes"]
    """R; its columns are tangent, normal and, in space, binormal."""
    turning: Float[Array, "n_axes n_axes"]
    """W = Rᵀ R' [1/s]."""
    turning_rate: Float[Array, "n_axes n_axes"]
    """W' [1/s²]."""
    speed: Scalar
    """s' of the reference along the contour, negative if it runs backwards [m/s]."""
    acceleration: Scalar
    """s'' [m/s²]."""
    rows: Derivatives
    """Derivatives of the contour over arc length, of the order of ``Sample.geometry``."""
    principal: Scalar
    """How much the normal is the principal one, 0 to 1, changing smoothly; 1 in the plane."""

    def from_axes(self, vector: AxisVector) -> AxisVector:
        """Return the components in the frame of a vector in axes.

        Parameters
        ----------
        vector
            Shape (n_axes,).
        """
        return vector @ self.rotation

    def to_axes(self, components: AxisVector) -> AxisVector:
        """Return the vector in axes of components in the frame.

        Parameters
        ----------
        components
            Shape (n_axes,).
        """
        return self.rotation @ components

    def components(
        self, vector: AxisVector, first: AxisVector, second: AxisVector
    ) -> tuple[AxisVector, AxisVector, AxisVector]:
        """Return a vector that depends on arc length in components, with two time derivatives.

        x = Rᵀ X,   x' = Rᵀ X_s s' - W x,   and x'' likewise.

        Parameters
        ----------
        vector, first, second
            X, dX/ds and d²X/ds² at the reference point, shape (n_axes,) in axes.
        """
        w, rate = self.turning, self.turning_rate
        x = self.from_axes(vector)
        along = self.from_axes(first) * self.speed
        x_1 = along - w @ x
        along_1 = (
            self.from_axes(second) * self.speed**2
            + self.from_axes(first) * self.acceleration
            - w @ along
        )
        return x, x_1, along_1 - rate @ x - w @ x_1


class CarriedState(NamedTuple):
    """What the frame in space remembers."""

    point: AxisVector
    """The last reference point [m]."""
    tangent: AxisVector
    """There."""
    normal: AxisVector
    """Of the frame, there."""
    twist: Scalar
    """ψ' [rad/s]."""
    offset: Scalar
    """Δ, the angle from the principal normal (or its opposite) to that of the frame [rad]."""
    offset_rate: Scalar
    """Δ' [rad/s]."""
    principal: Scalar
    """As in :class:`FrameMotion`."""
    following: Count
    """1 if the last frame followed that of Frenet, 2 if there was none yet; 0 if it was carried on
    because Frenet's turns too fast, -1 because there is none; int32."""


class ReferenceFrame(Configuration):
    """The frame at the reference point of a planar or spatial contour; see the module.

    Parameters
    ----------
    n_axes
        2 or 3.
    sample_time
        T > 0 [s].
    twist_limit
        Rate at which the frame may turn about the tangent, > 0 [rad/s]; in space.
    return_rate
        λ, at which a carried frame goes back to that of Frenet, > 0 [1/s]; in space.
    """

    n_axes: int = static(allowed=(2, 3))
    sample_time: Scalar = real(unit="s", above=0.0)
    twist_limit: Scalar = real(unit="rad/s", above=0.0)
    return_rate: Scalar = real(unit="1/s", above=0.0)

    @property
    def order(self) -> int:
        """Order of the contour's derivatives that W' needs."""
        return self.n_axes + 1

    def init(self, sample: Sample) -> Any:
        """Return the state before the first step: nothing in the plane.

        Parameters
        ----------
        sample
            The first sample, its ``geometry`` of ``order`` or more.
        """
        if self.n_axes == 2:
            return ()
        rows = arc_length_derivatives(sample.geometry)
        tangent = rows[1]
        axis = jnp.eye(3)[jnp.argmin(jnp.abs(tangent))]
        aside = unit(axis - tangent * (tangent @ axis))
        speed, acceleration = path_speed(sample)
        normal, twist, _, follow = self._frenet(rows, speed, acceleration, aside)
        good = follow == 1
        zero = jnp.zeros(())
        return CarriedState(
            rows[0], tangent, jnp.where(good, normal, aside), jnp.where(good, twist, 0.0),
            zero, zero, jnp.where(good, 1.0, 0.0), jnp.where(good, 2, follow),
        )  # fmt: skip

    def step(self, state: Any, sample: Sample) -> tuple[FrameMotion, Any]:
        """Return the frame at the reference point of a sample, and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """
        rows = arc_length_derivatives(sample.geometry)
        speed, acceleration = path_speed(sample)
        if self.n_axes == 2:
            tangent = rows[1]
            rotation = jnp.stack([tangent, left_normal(tangent)], axis=1)
            none = jnp.zeros(())
            return _motion(rotation, none, none, speed, acceleration, rows, jnp.ones(())), state
        normal, twist, twist_rate, state = self._carry(state, rows, speed, acceleration)
        tangent = rows[1]
        rotation = jnp.stack([tangent, normal, jnp.cross(tangent, normal)], axis=1)
        return (
            _motion(rotation, twist, twist_rate, speed, acceleration, rows, state.principal),
            state,
        )

    def held(self, state: Any) -> Array:
        """Return whether the frame was carried on because Frenet's turns too fast: 1 or 0, int32.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return (
            jnp.zeros((), jnp.int32)
            if self.n_axes == 2
            else (state.following == 0).astype(jnp.int32)
        )

    def _frenet(
        self, rows: Derivatives, speed: Scalar, acceleration: Scalar, aside: AxisVector
    ) -> tuple[AxisVector, Scalar, Scalar, Count]:
        """Return the principal normal, the twist that it asks for, its rate, and what to do.

        That is 1 to follow, 0 if it turns too fast, -1 if there is none.

        ``aside`` stands in where there is none.
        """
        tangent, bend, third, fourth = rows[1:5]
        square = bend @ bend
        curved = square > FLAT**2
        safe = jnp.where(curved, square, 1.0)
        normal = jnp.where(curved, bend / jnp.sqrt(safe), aside)
        cross = jnp.cross(tangent, bend)
        torsion = jnp.where(curved, (cross @ third) / safe, 0.0)
        change = (cross @ fourth) / safe - torsion * 2.0 * (bend @ third) / safe
        change = jnp.where(curved, change, 0.0)
        twist = torsion * speed
        twist_rate = change * speed**2 + torsion * acceleration
        slow = (jnp.abs(twist) <= self.twist_limit).astype(jnp.int32)
        follow = jnp.where(curved, slow, jnp.int32(-1))
        return normal, twist, twist_rate, follow

    def _carry(
        self, state: CarriedState, rows: Derivatives, speed: Scalar, acceleration: Scalar
    ) -> tuple[AxisVector, Scalar, Scalar, CarriedState]:
        """Return the normal, ψ', ψ'' and the new state."""
        period, rate, tangent = self.sample_time, self.return_rate, rows[1]
        decay = jnp.exp(-rate * period)
        carried = transport_normal(state.normal, state.point, state.tangent, rows[0], tangent)
        principal, frenet_twist, frenet_rate, follow = self._frenet(
            rows, speed, acceleration, carried
        )
        good = follow == 1
        # on its way back, or there
        pull = state.offset_rate + rate * state.offset
        offset = decay * (state.offset + pull * period)
        offset_rate = decay * (state.offset_rate - rate * pull * period)
        elapsed = jnp.where(state.following == 2, 0.0, period)  # none before the first step
        apart = _angle(principal, carried, tangent)
        here = apart + elapsed * 0.5 * (state.twist + frenet_twist + offset_rate)
        anew = (state.following <= 0) | (jnp.abs(_folded(here - offset)) > JUMP)
        here = jnp.where(anew, apart + elapsed * state.twist, here)
        offset = jnp.where(anew, _folded(here), offset)
        offset_rate = jnp.where(anew, state.twist - frenet_twist, offset_rate)
        side = jnp.where(jnp.cos(here - offset) < 0.0, -1.0, 1.0)
        back = turned(side * principal, tangent, offset)
        # carried on
        free_twist = state.twist * decay
        free = turned(carried, tangent, state.twist * (1.0 - decay) / rate)

        normal = jnp.where(good, back, free)
        twist = jnp.where(good, frenet_twist + offset_rate, free_twist)
        twist_rate = jnp.where(
            good,
            frenet_rate - 2.0 * rate * offset_rate - rate**2 * offset,
            -rate * free_twist,
        )
        share = jnp.where(good, 1.0, 0.0) + decay * (state.principal - jnp.where(good, 1.0, 0.0))
        return (
            normal,
            twist,
            twist_rate,
            CarriedState(rows[0], tangent, normal, twist, offset, offset_rate, share, follow),
        )


def turned(vector: AxisVector, axis: AxisVector, angle: Scalar) -> AxisVector:
    """Return a vector normal to an axis, turned about it.

    Parameters
    ----------
    vector
        Normal to the axis, shape (3,).
    axis
        Unit vector.
    angle
        Right-handed [rad].
    """
    return jnp.cos(angle) * vector + jnp.sin(angle) * jnp.cross(axis, vector)


def _angle(start: AxisVector, end: AxisVector, axis: AxisVector) -> Scalar:
    return jnp.arctan2(jnp.cross(start, end) @ axis, start @ end)


def _folded(angle: Scalar) -> Scalar:
    """Return an angle between lines, -π/2 to π/2."""
    return angle - np.pi * jnp.round(angle / np.pi)


def path_speed(sample: Sample) -> tuple[Scalar, Scalar]:
    """Return s' and s''."""
    first, second = sample.geometry[1], sample.geometry[2]
    reference = sample.reference
    square = first @ first
    still = square == 0.0
    size = jnp.sqrt(jnp.where(still, 1.0, square))
    speed = size * reference.parameter_rate
    acceleration = (
        size * reference.parameter_acceleration
        + (first @ second) / size * reference.parameter_rate**2
    )
    return jnp.where(still, 0.0, speed), jnp.where(still, 0.0, acceleration)


def _motion(
    rotation: Array, twist: Scalar, twist_rate: Scalar, speed: Scalar, acceleration: Scalar,
    rows: Derivatives, principal: Scalar,
) -> FrameMotion:  # fmt: skip
    bend, third = rows[2] @ rotation, rows[3] @ rotation
    if len(bend) == 2:
        across = jnp.stack([bend[1]])
        change = jnp.stack([third[1]]) * speed
    else:
        across = bend[1:]
        # E_n' and E_b' hold ± ψ' of each other
        change = third[1:] * speed + twist * jnp.stack([bend[2], -bend[1]])
    turning = _skew(across * speed, twist)
    turning_rate = _skew(change * speed + across * acceleration, twist_rate)
    return FrameMotion(rotation, turning, turning_rate, speed, acceleration, rows, principal)


def _skew(across: Array, twist: Scalar) -> Array:
    """Return (2) from the rates at which the tangent turns towards each normal, and ψ'."""
    zero = jnp.zeros(())
    if len(across) == 1:
        return jnp.stack([jnp.stack([zero, -across[0]]), jnp.stack([across[0], zero])])
    return jnp.stack(
        [
            jnp.stack([zero, -across[0], -across[1]]),
            jnp.stack([across[0], zero, -twist]),
            jnp.stack([across[1], twist, zero]),
        ]
    )
