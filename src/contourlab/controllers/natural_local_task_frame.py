"""Contouring control in the local task frame by natural local approximation of the contour.

The contour near the reference point is replaced by a curve over the tangent, whose offsets across
it are, for the error t along the path,

    g_i(t) = k_i t² / 2 + c_i t³ / 6,    k_i = r_ss · E_i,    i = n, b                  (1)

and what is controlled is z = (t, n - g_n, b - g_b): the second and third are the estimated contour
error (15), (16). With z' as its exact time derivative and V = -KP z - KD z', the law wants

    t'' = V_1
    n'' = V_2 + (dg/dt) t'' + (k + c t) t'² + 2 (k' t + c' t²/2) t' + k'' t²/2 + c'' t³/6   (2)

for n, and the like for b, after which feedback linearisation takes over
(:mod:`~contourlab.controllers.task_frame`). With a perfect model and fast sampling z obeys (24),
z'' = -KP z - KD z', each direction by itself: a large and slow error along the path does not
disturb the error across it. In the first-order law it does, by κ t² / 2.

``estimate``
    ``"extended"`` (the default): c_i = r_sss · E_i, every term of third order: κ'(s) across and κ τ
    along the binormal. ``"natural"``: that of the paper, which keeps κ τ and drops κ'(s); in the
    plane it is then the parabola κ t² / 2, no better than the osculating circle.
``curvature_rates``
    Whether k', c', k'', c'' (time derivatives, as the reference runs along and the frame turns)
    stand in z' and (2). The paper leaves them out; without them the directions decouple only where
    curvature and torsion are constant.

The estimate is that of the offset at the same t, not of the distance: good while |k t| is well
below 1, and while the curvature does not change much over t. Beyond, no local expansion helps; use
a law with a foot point. Where t ≈ 0 the law is the first-order one.

References
----------
.. [MengLouZhou] equations (8) to (25).

Differences from the paper
--------------------------
The paper's law is ``estimate="natural", curvature_rates=False, hold_compensation=False,
friction_from="measured"``. Its (22) has a dot too many (M_Z Z_2', Z_2 being the derivative), and
its (27) lacks the exponent 3/2: the signed curvature is that of the frame here. Where the frame is
carried on (straight stretches and inflections in space) the natural estimate keeps κ'(s) too, since
there is no principal direction to leave it out of; between the two it passes smoothly.
"""

from __future__ import annotations

import jax.numpy as jnp

from contourlab.configuration import static
from contourlab.contours.base import Contour
from contourlab.controllers.frames import FrameMotion
from contourlab.controllers.frames.reference_frame import FLAT
from contourlab.controllers.task_frame import BoundTaskFrameController, TaskFrameController
from contourlab.typing import Array, AxisVector, Scalar, Vector

__all__ = ["BoundNaturalLocalTaskFrame", "NaturalLocalTaskFrame"]

Rates = tuple[Vector, Vector, Vector]
"""A value per normal direction, with its first and second time derivative."""


class NaturalLocalTaskFrame(TaskFrameController):
    """PD with feedback linearisation on the natural local estimate; see the module.

    Parameters
    ----------
    model
        Nominal model of 2 or 3 axes.
    bandwidth_hz
        f > 0 [Hz], (tangential, normal) or, in space, (tangential, normal, binormal); with two in
        space the binormal has that of the normal.
    damping
        ζ > 0, one number or one per direction.
    friction_compensation
        Share, 0 to 1, of the model's Coulomb friction that is compensated.
    friction_velocity
        Width of the smooth sign, > 0 [m/s].
    friction_from
        Whose sign: ``"reference"`` or ``"measured"`` velocity.
    hold_compensation
        Whether the command allows for being held over the sample time.
    estimate
        ``"extended"`` or ``"natural"``.
    curvature_rates
        Whether time derivatives of curvature and torsion count.

    Raises
    ------
    ConfigurationError
        A value out of bounds, or a wrong number of them.
    RefusedError
        The model is commanded by positions.
    """

    estimate: str = static(allowed=("extended", "natural"), default="extended")
    curvature_rates: bool = static(flag=True, default=True)

    @property
    def derivatives(self) -> int:
        """Order of the contour's derivatives that the law needs: 3 to 5."""
        if not self.curvature_rates:
            return self.n_axes + 1
        return 4 if self.n_axes == 2 and self.estimate == "natural" else 5

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundNaturalLocalTaskFrame:
        """Return the law for one contour and sample time.

        Parameters
        ----------
        contour
            The path that the loop follows.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            The contour has a corner, or not one coordinate per axis.
        ConfigurationError
            A damping or friction setting of the wrong number.
        """
        return BoundNaturalLocalTaskFrame(
            **self.bound_fields(contour, sample_time),
            extended=self.estimate == "extended",
            curvature_rates=self.curvature_rates,
        )


class BoundNaturalLocalTaskFrame(BoundTaskFrameController):
    """The discretised law; made by :meth:`NaturalLocalTaskFrame.bind`."""

    extended: bool = static(flag=True)
    curvature_rates: bool = static(flag=True)

    def acceleration(
        self, motion: FrameMotion, error: AxisVector, rate: AxisVector
    ) -> tuple[AxisVector, AxisVector]:
        """Return z and the acceleration that the law wants.

        Parameters
        ----------
        motion
            The frame and how it moves.
        error, rate
            f and f', shape (n_axes,).
        """
        t, t_1 = error[0], rate[0]
        k, k_1, k_2 = self._bend(motion)
        c, c_1, c_2 = self._third(motion)
        g = k * t**2 / 2.0 + c * t**3 / 6.0  # (1)
        slope = k * t + c * t**2 / 2.0  # dg/dt
        g_1 = slope * t_1 + k_1 * t**2 / 2.0 + c_1 * t**3 / 6.0
        none = jnp.zeros(1)
        z = error - jnp.concatenate([none, g])
        z_1 = rate - jnp.concatenate([none, g_1])
        v = -self.stiffness_gain * z - self.damping_gain * z_1
        more = (
            slope * v[0]
            + (k + c * t) * t_1**2
            + 2.0 * (k_1 * t + c_1 * t**2 / 2.0) * t_1
            + k_2 * t**2 / 2.0
            + c_2 * t**3 / 6.0
        )
        return z, v + jnp.concatenate([none, more])  # (2)

    def _bend(self, motion: FrameMotion) -> Rates:
        rows = motion.rows
        if not self.curvature_rates:
            return _still(motion, rows[2])
        return _moving(motion, rows[2], rows[3], rows[4])

    def _third(self, motion: FrameMotion) -> Rates:
        rows = motion.rows
        if not self.extended:
            if len(motion.rotation) == 2:
                none = jnp.zeros(1)
                return none, none, none
            left_out = _along_bend(motion, rates=self.curvature_rates)
            rows = jnp.asarray(rows).at[3 : 3 + len(left_out)].add(-motion.principal * left_out)
        if not self.curvature_rates:
            return _still(motion, rows[3])
        return _moving(motion, rows[3], rows[4], rows[5])


def _still(motion: FrameMotion, vector: AxisVector) -> Rates:
    value = motion.from_axes(vector)[1:]
    none = jnp.zeros_like(value)
    return value, none, none


def _moving(
    motion: FrameMotion, vector: AxisVector, first: AxisVector, second: AxisVector
) -> Rates:
    value, rate, change = motion.components(vector, first, second)
    return value[1:], rate[1:], change[1:]


def _along_bend(motion: FrameMotion, *, rates: bool) -> Array:
    """Return κ'(s) N = (r_ss · r_sss / κ²) r_ss and, if asked, two derivatives over arc length.

    Where there is no principal normal the derivatives are 0.
    """
    bend, third, fourth = motion.rows[2], motion.rows[3], motion.rows[4]
    square = bend @ bend
    curved = square > FLAT**2
    square = jnp.where(curved, square, FLAT**2)
    half = bend @ third
    h = half / square
    if not rates:
        return jnp.stack([h * bend])
    fifth = motion.rows[5]
    half_1 = third @ third + bend @ fourth
    half_2 = 3.0 * (third @ fourth) + bend @ fifth
    h_1 = (half_1 - 2.0 * h * half) / square
    h_2 = (half_2 - 4.0 * h_1 * half - 2.0 * h * half_1) / square
    first = h_1 * bend + h * third
    second = h_2 * bend + 2.0 * h_1 * third + h * fourth
    return jnp.stack([h * bend, jnp.where(curved, first, 0.0), jnp.where(curved, second, 0.0)])
