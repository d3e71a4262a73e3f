"""What a contour is: a curve as geometry, without time and without a machine."""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import Configuration
from contourlab.contours.level import Level
from contourlab.errors import GeometryError
from contourlab.typing import Array, AxisVector, Count, Derivatives, Scalar

__all__ = ["ClosedFormContour", "Contour", "Frenet", "derivatives_by_jvp", "left_normal", "unit"]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_PANELS = 48


class Frenet(eqx.Module):
    """The moving frame at one point of a contour.

    In the plane the frame comes from the tangent alone: the normal is the tangent turned by +90°,
    the curvature is signed, and nothing is singular at an inflection; binormal and torsion do not
    exist, and to ask for them is a GeometryError. In space the curvature is not negative and the
    normal points to the centre of curvature; where the curvature vanishes the normal is a defined
    perpendicular (see :meth:`Contour.frenet`).
    """

    tangent: AxisVector
    normal: AxisVector
    curvature: Scalar
    _binormal: AxisVector | None = None
    _torsion: Scalar | None = None

    @property
    def binormal(self) -> Array:
        """Unit binormal, shape (3,), or of a batch."""
        return only_in_space("binormal", self._binormal)  # type: ignore[no-any-return]

    @property
    def torsion(self) -> Array:
        """Torsion [1/m], positive for a right-handed helix; a scalar, or of a batch."""
        return only_in_space("torsion", self._torsion)  # type: ignore[no-any-return]


def only_in_space(name: str, value: Any) -> Any:
    """Return a value, or raise GeometryError if there is none.

    Parameters
    ----------
    name
        What it is.
    value
        None in the plane.

    Raises
    ------
    GeometryError
        The contour is planar.
    """
    if value is None:
        raise GeometryError(f"a planar contour has no {name}")
    return value


class Contour(Configuration):
    """A curve: position and derivatives over one scalar parameter.

    Everything takes one scalar parameter; ``jax.vmap`` outside gives records. Outside its domain an
    open contour continues as its formula does (a path continues its end piece), a closed one
    repeats.

    A law that evaluates the contour inside the loop keeps the *piece* that it was in, an int32, and
    passes it on: ``piece = contour.locate(parameter, piece)``. For formula curves there is one
    piece, 0; for a :class:`Path` the hint makes the look-up some 40 times cheaper.
    """

    @property
    @abc.abstractmethod
    def n_axes(self) -> int:
        """Number of coordinates of the tool point."""

    @property
    @abc.abstractmethod
    def domain(self) -> tuple[Scalar, Scalar]:
        """Start and end of the parameter."""

    @property
    @abc.abstractmethod
    def closed(self) -> bool:
        """Whether the end is the start, and the parameter goes round."""

    @abc.abstractmethod
    def position(self, parameter: Scalar, piece: Count | None = None) -> AxisVector:
        """Return the point at one parameter, shape (n_axes,) [m].

        Parameters
        ----------
        parameter
            One scalar; right-sided at joints.
        piece
            What ``locate`` returned for this parameter; looked up when None.
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
            What ``locate`` returned for this parameter; looked up when None.

        Returns
        -------
        Derivatives
            Shape (order + 1, n_axes) [m per parameter unit^k]; right-sided at joints.
        """
        return derivatives_by_jvp(lambda p: self.position(p, piece), parameter, order)

    def locate(self, parameter: Scalar, piece: Count) -> Count:
        """Return the piece that holds a parameter, starting the search at another piece.

        Parameters
        ----------
        parameter
            One scalar.
        piece
            Where to start, int32.
        """
        del parameter
        return piece

    def wrap(self, parameter: Scalar) -> Scalar:
        """Return the parameter inside the domain: wrapped if the contour is closed, else clipped.

        Parameters
        ----------
        parameter
            One scalar.
        """
        start, end = self.domain
        if self.closed:
            period = end - start
            return start + jnp.mod(parameter - start, period)
        return jnp.clip(parameter, start, end)

    def frenet(self, parameter: Scalar, piece: Count | None = None) -> Frenet:
        """Return the Frenet frame at one parameter.

        Planar: tangent, left normal, signed curvature ``(x' y'' - y' x'') / |r'|^3``, positive for
        a left turn. Spatial: principal normal, binormal, curvature ``|r' x r''| / |r'|^3``, torsion
        ``(r' x r'') . r''' / |r' x r''|^2``, positive for a right-handed helix.

        Where a spatial contour is straight to rounding, ``|r' x r''|`` being no more than 1e-12 of
        ``|r'| max(|r''|, sqrt(|r'| |r'''|))``, the normal is the coordinate axis least aligned with
        the tangent, made perpendicular to it, the binormal completes the frame, and curvature and
        torsion are 0. The principal normal itself jumps by 180° at a spatial inflection. Where the
        contour stands still (a cusp) the tangent is the zero vector and the curvature 0.

        On the contour run backwards the tangent and the planar normal and curvature change sign; in
        space the normal, curvature and torsion stay, and tangent and binormal change sign.

        Parameters
        ----------
        parameter
            One scalar.
        piece
            As in ``derivatives``.

        Raises
        ------
        GeometryError
            The contour is neither planar nor spatial.
        """
        if self.n_axes == 2:
            d = self.derivatives(parameter, 2, piece)
            tangent = unit(d[1])
            speed = _safe_speed(d[1])
            curvature = (d[1, 0] * d[2, 1] - d[1, 1] * d[2, 0]) / speed**3
            return Frenet(tangent, left_normal(tangent), curvature)
        if self.n_axes != 3:
            raise GeometryError(
                f"a Frenet frame needs a contour of 2 or 3 axes, this one has {self.n_axes}"
            )
        d = self.derivatives(parameter, 3, piece)
        tangent = unit(d[1])
        speed = _safe_speed(d[1])
        cross = jnp.cross(d[1], d[2])
        size2 = cross @ cross
        bend = jnp.maximum(d[2] @ d[2], speed * jnp.sqrt(d[3] @ d[3]))
        straight = size2 <= 1e-24 * speed**2 * bend
        safe2 = jnp.where(straight, 1.0, size2)
        axis = jnp.eye(3)[jnp.argmin(jnp.abs(tangent))]
        fallback = unit(axis - tangent * (tangent @ axis))
        binormal = jnp.where(straight, jnp.cross(tangent, fallback), cross / jnp.sqrt(safe2))
        normal = jnp.cross(binormal, tangent)
        curvature = jnp.where(straight, 0.0, jnp.sqrt(safe2) / speed**3)
        torsion = jnp.where(straight, 0.0, (cross @ d[3]) / safe2)
        return Frenet(tangent, normal, curvature, binormal, torsion)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length of the stretch between two parameters [m], negative if end < start.

        By Gauss-Legendre quadrature of the speed, 48 panels of 12 nodes: exact to rounding unless
        the speed varies by orders of magnitude within one panel.

        Parameters
        ----------
        start, end
            Parameters; a closed contour may go round several times.
        """
        edges = start + (end - start) * jnp.arange(_PANELS)[:, None] / _PANELS
        width = (end - start) / _PANELS
        nodes = (edges + width * (0.5 + 0.5 * jnp.asarray(_NODES))).reshape(-1)
        speed = jax.vmap(lambda p: jnp.linalg.norm(self.derivatives(p, 1)[1]))(nodes)
        return 0.5 * width * jnp.sum(speed.reshape(_PANELS, -1) * jnp.asarray(_WEIGHTS))

    @property
    def length(self) -> Scalar:
        """Length of the whole contour [m]."""
        return self.arc_length(*self.domain)

    # -- implicit form ------------------------------------------------------------------------

    @property
    def has_level(self) -> bool:
        """Whether the contour has an implicit form of its own, in closed form."""
        return type(self).level_derivatives is not Contour.level_derivatives

    def level(self, position: AxisVector) -> Scalar:
        """Return the implicit form: 0 on the contour, > 0 on the right of the direction of travel.

        Parameters
        ----------
        position
            Shape (2,) [m].

        Raises
        ------
        GeometryError
            The contour has none.
        """
        return self.level_derivatives(position).value

    def level_derivatives(self, position: AxisVector) -> Level:
        """Return the implicit form, its gradient and its Hessian.

        Parameters
        ----------
        position
            Shape (2,) [m].

        Raises
        ------
        GeometryError
            The contour has none.
        """
        del position
        raise GeometryError(
            f"{type(self).__name__} has no implicit form of its own; "
            "contours.SignedDistance makes one of any planar contour"
        )

    # -- transformations ----------------------------------------------------------------------

    def translated(self, offset: Any) -> Contour:
        """Return the contour shifted.

        Parameters
        ----------
        offset
            Shape (n_axes,) [m].

        Raises
        ------
        GeometryError
            An offset of another shape.
        """
        from contourlab.contours.transformations import translated  # which holds contours

        return translated(self, offset)

    def rotated(self, angle: Any, *, axis: Any = None, center: Any = None) -> Contour:
        """Return the contour turned.

        Parameters
        ----------
        angle
            [rad]: counter-clockwise, in space as seen from the tip of the axis.
        axis
            In space: direction of the axis, shape (3,), of any length > 0.
        center
            Point that stays, shape (n_axes,) [m]; the origin when None.

        Raises
        ------
        GeometryError
            An axis that is missing, superfluous or zero; a contour of neither 2 nor 3 axes.
        """
        from contourlab.contours.transformations import rotated

        return rotated(self, angle, axis=axis, center=center)

    def scaled(self, factor: Any, *, center: Any = None) -> Contour:
        """Return the contour scaled.

        Parameters
        ----------
        factor
            One number, or one for each axis, none 0. ``(1.0, -1.0)`` reflects a planar contour.
        center
            Point that stays, shape (n_axes,) [m]; the origin when None.

        Raises
        ------
        GeometryError
            A factor of 0 or of another shape; a path with helices scaled by different factors.
        """
        from contourlab.contours.transformations import scaled

        return scaled(self, factor, center=center)

    def reversed(self) -> Contour:
        """Return the contour run from its end to its start, over the same domain.

        The point at p is that of the original at start + end - p. Tangent, planar normal and
        signed curvature change sign, and so does the implicit form.
        """
        from contourlab.contours.transformations import reversed_contour

        return reversed_contour(self)

    def between(self, start: Any, end: Any) -> Contour:
        """Return the stretch between two parameters, as an open contour.

        The parameter stays the same; that of a path, which is arc length, begins again at 0.

        Parameters
        ----------
        start, end
            Parameters, start < end: within the domain of an open contour, at most one round apart
            on a closed one.

        Raises
        ------
        GeometryError
            Parameters out of order or out of the domain.
        """
        from contourlab.contours.transformations import between

        return between(self, start, end)


class ClosedFormContour(Contour):
    """A formula curve that gives its derivatives in closed form, its point among them."""

    @abc.abstractmethod
    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the parameter, in closed form.

        Parameters
        ----------
        parameter
            One scalar.
        order
            Highest derivative, >= 0; static.
        piece
            Not needed: a formula curve has one piece.
        """

    def position(self, parameter: Scalar, piece: Count | None = None) -> AxisVector:
        """Return the point at one parameter, shape (n_axes,) [m].

        Parameters
        ----------
        parameter
            One scalar.
        piece
            Not needed: a formula curve has one piece.
        """
        return self.derivatives(parameter, 0, piece)[0]


def derivatives_by_jvp(curve: Callable[[Scalar], Array], parameter: Scalar, order: int) -> Array:
    """Return a curve and its derivatives by chained forward differentiation, exact to rounding.

    Parameters
    ----------
    curve
        From one scalar to a vector.
    parameter
        Where.
    order
        Highest derivative.

    Returns
    -------
    Array
        Shape (order + 1, n).
    """
    if order < 0:
        raise GeometryError(f"order must be >= 0, got {order}")
    parameter = jnp.asarray(parameter, dtype=float)
    rows, function = [], curve
    for k in range(order + 1):
        rows.append(function(parameter))
        if k < order:
            function = _derivative(function)
    return jnp.stack(rows)


def _derivative(function: Callable[[Scalar], Array]) -> Callable[[Scalar], Array]:
    def derivative(parameter: Scalar) -> Array:
        return jax.jvp(function, (parameter,), (jnp.ones_like(parameter),))[1]  # type: ignore[no-any-return]

    return derivative


def _safe_speed(slope: AxisVector) -> Scalar:
    """Return |r'|, or 1 where the contour stands still."""
    squared = slope @ slope
    return jnp.sqrt(jnp.where(squared == 0.0, 1.0, squared))


def unit(vector: AxisVector) -> AxisVector:
    """Return a vector's direction; the zero vector stays zero, with a zero derivative.

    Parameters
    ----------
    vector
        Any vector.
    """
    squared = vector @ vector
    zero = squared == 0.0
    return jnp.where(zero, 0.0, vector) / jnp.sqrt(jnp.where(zero, 1.0, squared))


def left_normal(tangent: AxisVector) -> AxisVector:
    """Return a planar vector turned by +90°.

    Parameters
    ----------
    tangent
        Shape (2,).
    """
    return jnp.stack([-tangent[1], tangent[0]])
