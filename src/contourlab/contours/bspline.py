"""B-splines of any degree in any number of axes."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from contourlab.contours.spline import Spline, scaled, spline_taylor
from contourlab.typing import Count, Derivatives, Scalar

__all__ = ["BSpline"]


class BSpline(Spline):
    """A polynomial spline; the parameter runs over its knots.

    Its knots may be clamped at the ends or not, and repeated; see
    :mod:`contourlab.contours.knots` for how they and the control points are counted.

    Parameters
    ----------
    control_points
        Shape (n_control, n_axes) [m], degree + 1 or more. Closed, they go round: none is repeated.
    knots
        Not decreasing: n_control + degree + 1, or n_control + 1 for one period of a closed spline.
        Equidistant from 0 to 1 if left out, and then clamped at open ends.
    degree
        1 to 25.
    closed
        Whether the end is the start and the parameter goes round.

    Raises
    ------
    GeometryError
        Knots of a wrong count, decreasing or repeated too often; control points repeated so that
        the curve stands still at a knot.
    ConfigurationError
        A number that is not finite; a degree that is not allowed.
    """

    def _homogeneous(self) -> Any:
        points = np.asarray(self.control_points)
        return np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)

    def _on_span(self, at: Scalar, order: int, span: Count) -> Derivatives:
        points, knots = self._local(jnp.asarray(self.control_points), span)
        return scaled(spline_taylor(points, knots, at, order))
