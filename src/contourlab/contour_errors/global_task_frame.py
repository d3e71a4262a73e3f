"""Contour error of the global task frame: the contour's implicit form over its gradient.

A planar contour given by f(x, y) = 0 has the coordinate

    r_c = f / |∇f|                                                (1)

across it, zero on the contour, which takes no account of where the reference point is. The estimate
is that coordinate back to the contour, along the gradient,

    error = -r_c ∇f / |∇f| = -f ∇f / |∇f|²                        (2)

which is one step of Newton's method for f = 0 from the actual point. There is no error from the
lag, however large: the tool is judged where it is.

Exact on the contour, and wherever f is the signed distance. Otherwise, with δ the true distance on
the side where f > 0, n the unit normal ∇f / |∇f| and H the Hessian of f, both at the foot point,

    r_c = δ - (δ² / 2) n·H n / |∇f| + O(δ³)                       (3)

second order in the error itself; how large depends on the form f, not only on the curve. For
x²/a² + y²/b² - 1 on a circle r_c = δ - δ² / (2 R) + O(δ³). The direction is exact on a circle;
elsewhere off by the rate at which the direction of ∇f turns along the normal, first order in δ.

It fails far from the contour: where ∇f vanishes (the centre of a circle or an ellipse) r_c is
infinite and the direction undefined. At that very point the vector runs to the reference point.
On a contour that comes near itself it is drawn to the nearer branch, whichever the tool is on. An
open contour goes on as f does.

Only for contours that have an implicit form of their own (``has_level``). With the signed distance
(``contours.SignedDistance``), which any planar contour has, (2) is the exact contour error: that is
:class:`FootPointEstimator`.

References
----------
.. [HuYaoWang] the orthogonal global task coordinate frame; (1) is the paper's, the direction is
   that of its (3).

Differences from the paper
--------------------------
The paper uses r_c as a coordinate to be regulated; the vector (2) is that coordinate along the
paper's unit normal. Its claim that r_c is essentially the contour error is made precise by (3).
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from contourlab.configuration import part
from contourlab.contour_errors.base import ContourEstimator, Estimator, EstimatorNeeds
from contourlab.contours.base import Contour
from contourlab.errors import RefusedError
from contourlab.recordings.sample import Sample
from contourlab.typing import AxisVector, Scalar

__all__ = ["GlobalTaskFrameEstimator"]


class GlobalTaskFrameEstimator(ContourEstimator):
    """Contour error vector f ∇f / |∇f|² of a contour with an implicit form; see the module."""

    @property
    def needs(self) -> EstimatorNeeds:
        """The contour itself, in the plane; the reference point where the gradient vanishes."""
        return EstimatorNeeds(derivatives=0, contour=True, coordinates=(2,))

    def bind(self, contour: Contour, sample_time: Scalar) -> Estimator:
        """Return the estimator for one contour.

        Parameters
        ----------
        contour
            The path that the loop follows.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            The contour is not planar, or has no implicit form.
        """
        super().bind(contour, sample_time)
        if not contour.has_level:
            raise RefusedError(
                "GlobalTaskFrameEstimator needs the contour's implicit form, level_derivatives("
                f"position), and {type(contour).__name__} has none of its own; use "
                "FootPointEstimator or NewtonEstimator, which take any contour"
            )
        return BoundGlobalTaskFrameEstimator(contour=contour)


class BoundGlobalTaskFrameEstimator(GlobalTaskFrameEstimator):
    """The estimator with its contour; made by :meth:`GlobalTaskFrameEstimator.bind`."""

    contour: Any = part()

    def estimate(self, sample: Sample) -> AxisVector:
        """Return the estimated contour error vector.

        Parameters
        ----------
        sample
            One instant, in tool space; ``geometry`` to order 0.

        Returns
        -------
        AxisVector
            From the actual point along the gradient, shape (2,) [m].
        """
        f, gradient, _ = self.contour.level_derivatives(sample.position)
        square = gradient @ gradient
        flat = square == 0.0
        error = -f * gradient / jnp.where(flat, 1.0, square)  # (1), (2)
        return jnp.where(flat, sample.geometry[0] - sample.position, error)
