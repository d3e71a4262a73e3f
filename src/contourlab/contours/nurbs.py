"""Rational B-splines (NURBS) of any degree in any number of axes."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import is_concrete, real
from contourlab.contours.spline import Spline, refuse_unfinite, scaled, spline_taylor
from contourlab.errors import ConfigurationError, GeometryError
from contourlab.typing import Array, Count, Derivatives, Scalar

__all__ = ["Nurbs"]


class Nurbs(Spline):
    """A rational spline; the parameter runs over its knots.

    Conics are exact in it: a circle is quadratic, with weights 1 and cos of half the angle that a
    piece turns.

    Parameters
    ----------
    control_points
        Shape (n_control, n_axes) [m], degree + 1 or more. Closed, they go round: none is repeated.
    weights
        Shape (n_control,), > 0.
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
        the curve stands still at a knot; weights of another count.
    ConfigurationError
        A weight that is not > 0; a number that is not finite; a degree that is not allowed.
    """

    weights: Float[Array, "... n_weights"] = real(above=0.0, ndim=1)

    def __check_init__(self) -> None:
        value = self.weights
        if not isinstance(value, np.ndarray | jax.Array) or not is_concrete(value):
            return
        weights = np.asarray(value)
        refuse_unfinite("weights", weights)
        if weights.dtype.kind == "f" and not (weights > 0.0).all():
            at = tuple(int(i) for i in np.argwhere(~(weights > 0.0))[0])
            shown = "".join(f"[{i}]" for i in at)
            raise ConfigurationError(f"weights must be > 0, got weights{shown} = {weights[at]:g}")

    def check(self) -> None:
        """Raise GeometryError unless there is a weight for each control point, and as Spline."""
        shape = self.control_points.shape
        if self.weights.ndim == 0 or len(shape) < 2 or self.weights.shape[-1] != shape[-2]:
            raise GeometryError(
                f"weights must be one for each of the control points of shape {shape}, "
                f"got shape {self.weights.shape}"
            )
        super().check()

    def _homogeneous(self) -> Any:
        weights = np.asarray(self.weights)[..., None]
        weighted = np.asarray(self.control_points) * weights
        weights = np.broadcast_to(weights, (*weighted.shape[:-1], 1))
        return np.concatenate([weighted, weights], axis=-1)

    def _on_span(self, at: Scalar, order: int, span: Count) -> Derivatives:
        weights = jnp.asarray(self.weights)[:, None]
        control = jnp.concatenate([jnp.asarray(self.control_points) * weights, weights], axis=1)
        points, knots = self._local(control, span)
        numerator = spline_taylor(points, knots, at, order)
        inverse = 1.0 / numerator[0][-1]
        curve: list[Any] = []
        for k, row in enumerate(numerator):  # the quotient of two Taylor series
            rest = row[:-1]
            for j in range(1, k + 1):
                rest = rest - numerator[j][-1] * curve[k - j]
            curve.append(rest * inverse)
        return scaled(curve)
