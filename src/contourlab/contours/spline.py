"""What B-splines and NURBS share: evaluation by de Boor's algorithm, spans as pieces, arc length.

With the 2p knots round a span, one step of de Boor's algorithm takes shares of neighbouring points,
and a difference of neighbours over the same knots is a derivative. Both kinds of step commute: the
k-th Taylor coefficient is ``comb(p, k)`` times what p - k steps and then k differences leave.
A rational curve is the quotient of two such series. So derivatives are exact to any order, and
those of more than the degree vanish where nothing is divided.
"""

from __future__ import annotations

import abc
from math import comb, factorial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from contourlab.configuration import is_concrete, real, static
from contourlab.contours.base import Contour
from contourlab.contours.knots import (
    MOST_DEGREE,
    bezier_pieces,
    check_knots,
    domain_knots,
    uniform_knots,
)
from contourlab.contours.path import Path
from contourlab.contours.spline_paths import path_of_pieces
from contourlab.errors import ConfigurationError, GeometryError
from contourlab.typing import Array, AxisVector, Count, Derivatives, Scalar

__all__ = ["Spline"]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_PANELS = 48
"""Panels of the quadrature over the whole curve, and at least ``_PER_SPAN`` for each span."""
_PER_SPAN = 4

Rows = NDArray[Any]


class Spline(Contour):
    """A spline of any degree over any knots, open or closed; the parameter is the knots' own.

    Spans between knots are its pieces. Where a knot stands ``degree`` times the curve may have a
    corner; derivatives are right-sided at knots. Beyond its ends an open spline goes on as the
    polynomials of its last spans do.
    """

    control_points: Float[Array, "... n_control n_axes"] = real(unit="m", ndim=2)
    """Shape (n_control, n_axes) [m]; on a closed spline none is repeated at the end."""
    knots: Float[Array, "... n_knots"] | None = real(ndim=1, default=None)
    """n_control + degree + 1, or n_control + 1 if closed; equidistant from 0 to 1 if left out."""
    degree: int = static(minimum=1, default=3)
    closed: bool = static(flag=True, default=False)

    def __check_init__(self) -> None:
        if not isinstance(self.degree, int) or self.degree > MOST_DEGREE:
            raise ConfigurationError(
                f"degree must be a whole number from 1 to {MOST_DEGREE}, got {self.degree!r}"
            )
        for name in ("control_points", "knots"):
            value = getattr(self, name)
            if isinstance(value, np.ndarray | jax.Array) and is_concrete(value):
                refuse_unfinite(name, np.asarray(value))

    def check(self) -> None:
        """Raise GeometryError unless knots and control points make a curve that stands nowhere."""
        shape = self.control_points.shape
        if len(shape) < 2 or shape[-1] < 1:
            raise GeometryError(f"control_points must have shape (n_control, n_axes), got {shape}")
        homogeneous, knots = np.asarray(self._homogeneous()), np.asarray(self._knots())
        check_knots(knots.reshape(-1, knots.shape[-1])[0], shape[-2], self.degree, self.closed)
        batch = np.broadcast_shapes(homogeneous.shape[:-2], knots.shape[:-1])
        homogeneous = np.broadcast_to(homogeneous, (*batch, *homogeneous.shape[-2:]))
        knots = np.broadcast_to(knots, (*batch, knots.shape[-1]))
        for index in np.ndindex(batch):
            check_knots(knots[index], shape[-2], self.degree, self.closed)
            self._check_moving(homogeneous[index], knots[index])

    def _check_moving(self, control: Rows, knots: Rows) -> None:
        """Raise GeometryError if a span has no length or the curve stands still at a knot."""
        rows, span = bezier_pieces(control, knots, self.degree, self.closed)
        points = rows[..., :-1] / rows[..., -1:]
        rounding = 4e-15 * np.max(np.abs(points), axis=(1, 2))
        still = np.max(np.abs(points - points[:, :1]), axis=(1, 2)) <= rounding
        if still.any():
            k = int(span[int(np.argmax(still))])
            raise GeometryError(
                f"control_points[{k}] to control_points[{(k + self.degree) % len(control)}] are "
                f"one point: the piece between two knots would have no length"
            )
        edges = domain_knots(knots, self.degree, self.closed)
        for side, (a, b) in enumerate(((0, 1), (-1, -2))):
            stands = np.max(np.abs(points[:, a] - points[:, b]), axis=1) <= rounding
            if stands.any():
                k = int(span[int(np.argmax(stands))])
                raise GeometryError(
                    f"the curve stands still at its knot {edges[k + side]:g}: control points are "
                    f"repeated among control_points[{k}] to "
                    f"control_points[{(k + self.degree) % len(control)}]"
                )

    @abc.abstractmethod
    def _homogeneous(self) -> Any:
        """Return control points (w x, w y, ..., w), shape (n_control, n_axes + 1)."""

    def _knots(self) -> Any:
        if self.knots is not None:
            return self.knots
        return uniform_knots(self.control_points.shape[-2], self.degree, self.closed)

    @property
    def knot_vector(self) -> Float[Array, " n_knots"]:
        """The knots, also where they were left out."""
        return self._knots()  # type: ignore[no-any-return]

    @property
    def n_axes(self) -> int:
        """Number of coordinates."""
        return int(self.control_points.shape[-1])

    @property
    def n_pieces(self) -> int:
        """Number of spans of the domain, empty ones between equal knots included."""
        n = int(self.control_points.shape[-2])
        return n if self.closed else n - self.degree

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """The first and the last knot that the curve reaches."""
        edges = self._edges()
        return edges[0], edges[-1]

    def _edges(self) -> Any:
        return domain_knots(self._knots(), self.degree, self.closed)

    def find(self, parameter: Scalar) -> Count:
        """Return the span that holds a parameter, by bisection; right-sided at knots.

        Parameters
        ----------
        parameter
            One scalar; wrapped on a closed spline.
        """
        at = jax.lax.stop_gradient(self.wrap(parameter) if self.closed else parameter)
        inner = jax.lax.stop_gradient(jnp.asarray(self._edges()[1:-1]))
        return jnp.searchsorted(inner, at, side="right").astype(jnp.int32)

    def locate(self, parameter: Scalar, piece: Count) -> Count:
        """Return the span that holds a parameter, walking from another one.

        Parameters
        ----------
        parameter
            One scalar; wrapped on a closed spline.
        piece
            Where to start, int32.
        """
        at = jax.lax.stop_gradient(self.wrap(parameter) if self.closed else parameter)
        edges = jax.lax.stop_gradient(jnp.asarray(self._edges()))
        last = self.n_pieces - 1

        def ahead(k: Any) -> Any:
            return (k < last) & (at >= edges[k + 1])

        def behind(k: Any) -> Any:
            return (k > 0) & (at < edges[k])

        index = jnp.clip(jnp.asarray(piece, jnp.int32), 0, last)
        index = jax.lax.while_loop(ahead, lambda k: k + 1, index)
        return jax.lax.while_loop(behind, lambda k: k - 1, index)

    def position(self, parameter: Scalar, piece: Count | None = None) -> AxisVector:
        """Return the point at one parameter, shape (n_axes,) [m].

        Parameters
        ----------
        parameter
            One scalar.
        piece
            Where to look for the span first; by bisection when None.
        """
        return self.derivatives(parameter, 0, piece)[0]

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the parameter, by de Boor's algorithm.

        Parameters
        ----------
        parameter
            One scalar.
        order
            Highest derivative, >= 0.
        piece
            Where to look for the span first, best what ``locate`` returned; by bisection when None.

        Returns
        -------
        Derivatives
            Shape (order + 1, n_axes) [m per parameter unit^k]; right-sided at knots.
        """
        if order < 0:
            raise GeometryError(f"order must be >= 0, got {order}")
        k = self.find(parameter) if piece is None else self.locate(parameter, piece)
        at = self.wrap(parameter) if self.closed else parameter
        return _on_span(self, at, order, k)

    @abc.abstractmethod
    def _on_span(self, at: Scalar, order: int, span: Count) -> Derivatives:
        """Return derivatives by the polynomials of one span, whether it holds the parameter."""

    def _local(self, control: Array, span: Count) -> tuple[Array, Array]:
        """Return the control points of a span and the 2p knots round it."""
        p, knots = self.degree, jnp.asarray(self._knots())
        row = span + jnp.arange(p + 1)
        around = span + 1 + jnp.arange(2 * p)
        if not self.closed:
            return control[row], knots[around]
        n = control.shape[0]
        around = around - p
        lap = jnp.floor_divide(around, n)
        return control[row % n], knots[around - lap * n] + lap * (knots[-1] - knots[0])

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length of the stretch between two parameters [m], negative if end < start.

        By Gauss-Legendre quadrature of the speed, span by span, 4 panels of 12 nodes in each or
        more: exact to rounding unless the speed varies by orders of magnitude within one panel.

        Parameters
        ----------
        start, end
            Parameters; a closed spline may go round several times.
        """
        return _between(self, start, end)

    def _travelled(self, parameter: Scalar) -> Scalar:
        edges = jnp.asarray(self._edges())
        if not self.closed:
            return jnp.sum(self._lengths(parameter))
        laps = jnp.floor((parameter - edges[0]) / (edges[-1] - edges[0]))
        rest = parameter - laps * (edges[-1] - edges[0])
        return jnp.sum(self._lengths(rest)) + laps * jnp.sum(self._lengths(edges[-1]))

    def _lengths(self, parameter: Scalar) -> Array:
        """Return the length of every span up to a parameter; end spans go on beyond the ends."""
        n = self.n_pieces
        panels = max(_PER_SPAN, -(-_PANELS // n))
        edges = jnp.asarray(self._edges())
        k = jnp.arange(n, dtype=jnp.int32)
        low, high = edges[:-1], edges[1:]
        end = jnp.clip(parameter, low, high)
        if not self.closed:
            end = jnp.where((k == 0) & (parameter < low), parameter, end)
            end = jnp.where((k == n - 1) & (parameter > high), parameter, end)
        width = (end - low) / panels
        inner = jnp.arange(panels)[:, None] + 0.5 + 0.5 * jnp.asarray(_NODES)
        nodes = low[:, None] + width[:, None] * inner.reshape(-1)

        def speed(at: Scalar, span: Count, empty: Any) -> Array:
            slope = self._on_span(at, 1, span)[1]
            squared = jnp.where(empty, 1.0, slope @ slope)
            return jnp.where(empty, 0.0, jnp.sqrt(squared))

        # an empty span has no polynomial of its own: that of the first stands in, times nothing
        empty = high <= low
        span = jnp.where(empty, 0, k)
        of_nodes = jax.vmap(speed, in_axes=(0, None, None))
        speeds = jax.vmap(of_nodes)(nodes, span, empty).reshape(n, panels, -1)
        return 0.5 * width * jnp.sum(speeds @ jnp.asarray(_WEIGHTS), axis=1)

    def to_path(self) -> Path:
        """Return the same curve as a path, of which the parameter is arc length.

        Exact: every span becomes one Bézier curve or more, a spline of degree 1 lines.

        Raises
        ------
        GeometryError
            The curve stands still within a span (a cusp); says between which knots.
        """
        knots = np.asarray(self._knots())
        rows, span = bezier_pieces(np.asarray(self._homogeneous()), knots, self.degree, self.closed)
        edges = domain_knots(knots, self.degree, self.closed)
        return path_of_pieces(rows, [(edges[k], edges[k + 1]) for k in span], closed=self.closed)


@eqx.filter_jit
def _on_span(spline: Spline, at: Scalar, order: int, span: Count) -> Array:
    """Compiled also when it is not called from compiled code: it is many small operations."""
    return spline._on_span(at, order, span)


@eqx.filter_jit
def _between(spline: Spline, start: Scalar, end: Scalar) -> Scalar:
    return spline._travelled(end) - spline._travelled(start)


def refuse_unfinite(name: str, value: Rows) -> None:
    """Raise ConfigurationError at the first number that is not finite.

    Parameters
    ----------
    name
        Of the field.
    value
        Its value.
    """
    if value.dtype.kind == "f" and not np.isfinite(value).all():
        at = tuple(int(i) for i in np.argwhere(~np.isfinite(value))[0])
        shown = "".join(f"[{i}]" for i in at)
        raise ConfigurationError(f"{name} must be finite, got {name}{shown} = {value[at]}")


def spline_taylor(points: Array, knots: Array, at: Scalar, order: int) -> list[Any]:
    """Return the Taylor coefficients of one span, d^k r/du^k / k!.

    Parameters
    ----------
    points
        Its control points, shape (degree + 1, width).
    knots
        The 2 degree knots round it.
    at
        Parameter.
    order
        Of the last coefficient, >= 0.

    Returns
    -------
    list
        Vectors of shape (width,), one for each coefficient.
    """
    p = points.shape[0] - 1
    series: list[Any] = [jnp.zeros_like(points[0])] * (order + 1)
    for step in range(p + 1):
        k = p - step
        if k <= order:  # k + 1 points are left
            rest = points
            for level in range(step, p):
                width = knots[p : 2 * p - level] - knots[level:p]
                rest = (rest[1:] - rest[:-1]) / width[:, None]
            series[k] = comb(p, k) * rest[0]
        if step < p:
            left, right = knots[step:p], knots[p : 2 * p - step]
            share = ((at - left) / (right - left))[:, None]
            points = points[:-1] + share * (points[1:] - points[:-1])
    return series


def scaled(series: list[Any]) -> Array:
    """Return derivatives from Taylor coefficients, shape (order + 1, n).

    Parameters
    ----------
    series
        Vectors.
    """
    return jnp.stack([factorial(k) * value for k, value in enumerate(series)])
