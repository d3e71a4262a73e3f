"""Contour error of Koren and Lo's variable-gain cross-coupling; in the plane.

The contour is replaced by its circle of curvature at the reference point and the distance to it is
expanded for errors small against the radius. With e = reference - actual, φ the angle of the
tangent and ρ the radius of curvature, signed, > 0 where the contour turns left:

    C_x = sin φ - e_x / (2 ρ)                                     (1)
    C_y = cos φ + e_y / (2 ρ)                                     (2)
    ε = -C_x e_x + C_y e_y                                        (3)

ε > 0 means that the contour lies to the left of the actual point. With N the left normal this is

    ε = N·e + |e|² / (2 ρ)                                        (4)

The law distributes its output over the axes with the gains (-C_x, C_y) = N + e / (2 ρ). The
estimate as a *vector*, from the actual point towards the contour, is therefore ε along these gains:

    error = ε (-C_x, C_y) / hypot(C_x, C_y)                       (5)

so that its magnitude is the paper's ε and its direction is the one in which the law pushes. That
direction has turned from the normal at the reference point by half the angle to the normal at the
foot point: it is off by κ e_t / 2, with e_t the tangential tracking error.

Exact on straight lines. On a circle the true distance is ρ (sqrt(1 + 2 ε/ρ) - 1), so that the
magnitude is off by ε² / (2 ρ) to leading order whatever the lag: 20 nm at an error of 20 µm and a
radius of 10 mm. Elsewhere κ' e_t³ / 6 comes on top: third order in the lag.

It fails when the error or the lag is no longer small against the radius, and at corners. Where
both gains vanish (e = -2 ρ N, the far side of the circle) the vector is zero.

References
----------
.. [KorenLo1991] variable-gain cross-coupling; the paper was not at hand.
.. [GhaffariUlsoy] names the scheme in its figure 5 and compares with it. (1) to (3) are the form in
   which it is commonly given; the numbering is ours, (4) and (5) are derived here.

Differences from the paper
--------------------------
The curvature 1/ρ is used, so that a straight stretch is no special case. The gains are normalised
in (5), so that the magnitude is that of ε; the law itself multiplies by the bare gains, whose
length is sqrt(1 + ε/ρ - |e|²/(4 ρ²)).
"""

from __future__ import annotations

import jax.numpy as jnp

from contourlab.contour_errors.base import Estimator, EstimatorNeeds
from contourlab.contours.base import left_normal, unit
from contourlab.recordings.sample import Sample
from contourlab.typing import AxisVector, Scalar

__all__ = ["VariableGainEstimator"]


class VariableGainEstimator(Estimator):
    """Koren and Lo's contour error along their gains; planar; see the module."""

    @property
    def needs(self) -> EstimatorNeeds:
        """The contour's first two derivatives at the reference parameter, in the plane."""
        return EstimatorNeeds(derivatives=2, coordinates=(2,))

    def gains(self, sample: Sample) -> tuple[Scalar, AxisVector]:
        """Return ε of (3) [m], > 0 if the contour is on the left, and the gains (-C_x, C_y).

        Parameters
        ----------
        sample
            One instant, in tool space; ``geometry`` to order 2.
        """
        point, first, second = sample.geometry[0], sample.geometry[1], sample.geometry[2]
        normal = left_normal(unit(first))
        speed2 = first @ first
        curvature = (normal @ second) / jnp.where(speed2 == 0.0, 1.0, speed2)
        e = point - sample.position
        gains = normal + e * (0.5 * curvature)  # (1), (2)
        return gains @ e, gains  # (3)

    def estimate(self, sample: Sample) -> AxisVector:
        """Return the estimated contour error vector.

        Parameters
        ----------
        sample
            One instant, in tool space; ``geometry`` to order 2.

        Returns
        -------
        AxisVector
            ε along the gains, from the actual point towards the contour, shape (2,) [m].
        """
        error, gains = self.gains(sample)
        return error * unit(gains)  # (5)
