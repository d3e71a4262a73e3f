"""Formula curves of the plane that stand somewhere: with a centre and a rotation."""

from __future__ import annotations

import abc

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contours.base import ClosedFormContour
from contourlab.errors import GeometryError
from contourlab.typing import Array, Count, Derivatives, Matrix, Scalar

__all__ = ["PlacedContour", "first_row", "harmonic"]


class PlacedContour(ClosedFormContour):
    """A planar formula curve in coordinates of its own, turned by an angle and shifted.

    A subclass gives its derivatives in its own coordinates, ``own_derivatives``.
    """

    center: Float[Array, "... n_axes"] = real(unit="m", ndim=1, default=(0.0, 0.0))
    rotation: Float[Array, " ..."] = real(unit="rad", ndim=0, default=0.0)

    def check(self) -> None:
        """Raise GeometryError unless the centre is a point of the plane."""
        if self.center.ndim == 0 or self.center.shape[-1] != 2:
            raise GeometryError(f"center must have 2 coordinates, got shape {self.center.shape}")

    @property
    def n_axes(self) -> int:
        """2."""
        return 2

    @abc.abstractmethod
    def own_derivatives(self, parameter: Scalar, order: int) -> Derivatives:
        """Return the point and its derivatives before the curve is turned and shifted.

        Parameters
        ----------
        parameter
            One scalar.
        order
            Highest derivative, >= 0.
        """

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the parameter.

        Parameters
        ----------
        parameter
            One scalar.
        order
            Highest derivative, >= 0; static.
        piece
            Not needed.

        Returns
        -------
        Derivatives
            Shape (order + 1, 2) [m per parameter unit^k].
        """
        del piece
        if order < 0:
            raise GeometryError(f"order must be >= 0, got {order}")
        rows = self.own_derivatives(jnp.asarray(parameter, float), order)
        cosine, sine = jnp.cos(self.rotation), jnp.sin(self.rotation)
        # by component: XLA then makes one loop of it over a batch, which it does not of products
        x, y = rows[:, 0], rows[:, 1]
        turned = jnp.stack([cosine * x - sine * y, sine * x + cosine * y], axis=1)
        return turned + first_row(order) * self.center

    def own_axes(self) -> Matrix:
        """Return the directions of the curve's own x and y, one a row."""
        cosine, sine = jnp.cos(self.rotation), jnp.sin(self.rotation)
        return jnp.stack([jnp.stack([cosine, sine]), jnp.stack([-sine, cosine])])


def first_row(order: int) -> Array:
    """Return 1 for the point and 0 for its derivatives, shape (order + 1, 1).

    Parameters
    ----------
    order
        Highest derivative, >= 0.
    """
    return np.eye(order + 1, 1)


def harmonic(
    first: Array | float, second: Array | float, frequency: Array | float, parameter: Scalar,
    order: int, phase: Array | float = 0.0,
) -> Array:  # fmt: skip
    """Return ``first cos(ω p + δ) + second sin(ω p + δ)`` and its derivatives over p.

    Parameters
    ----------
    first, second
        Shape (n_axes,), or one number each [m].
    frequency, phase
        ω and δ, each one number or one for each axis.
    parameter
        p.
    order
        Highest derivative, >= 0.

    Returns
    -------
    Array
        Shape (order + 1, n_axes), or (order + 1,) of numbers.
    """
    angle = frequency * parameter + phase
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    value, slope = first * cosine + second * sine, second * cosine - first * sine
    quarter_turns = (value, slope, -value, -slope)
    rows, factor = [value], frequency
    for k in range(1, order + 1):
        rows.append(quarter_turns[k % 4] * factor)
        factor = factor * frequency
    return jnp.stack(rows)
