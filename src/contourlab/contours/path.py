"""A path of many pieces, held as a struct of arrays, with arc length as its parameter.

There are two kinds of piece. *Helical* pieces are lines, arcs and helices in one formula that is
safe at zero curvature; *Bézier* pieces are rational Bézier curves, so that B-splines, NURBS, G5
splines and blends are exact. A piece is a row of numbers, never an object: a path of 100 000
pieces is a dozen arrays.

The formula of helical pieces is in :mod:`~contourlab.contours.helical`. The arc length of a Bézier
piece has no closed form: each is cut, when the path is made, into stretches on which its parameter
u is a Chebyshev series of s to 1e-13; the point is then exactly on the curve, and du/ds = 1/|dr/du|
holds exactly in every derivative.

Outside its domain an open path goes on: a helical end piece by its formula, a Bézier one straight
along its tangent.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from contourlab.configuration import real, static
from contourlab.contours.base import Contour
from contourlab.contours.bezier import bezier_derivatives
from contourlab.contours.bezier_rows import bezier_rows
from contourlab.contours.helical import helical_derivatives, helical_point
from contourlab.contours.joints import CORNER, Joints, path_joints
from contourlab.contours.path_rows import path_fields, positive_lengths
from contourlab.errors import GeometryError
from contourlab.typing import Array, AxisVector, Count, Derivatives, Scalar

__all__ = ["Path", "helical_derivatives", "helical_point"]


def _whole(value: Any) -> Any:
    return np.asarray(value, np.int32) if isinstance(value, np.ndarray | list | tuple) else value


class Path(Contour):
    """Pieces end to end; the parameter is arc length [m], derivatives are right-sided at joints.

    Made by :meth:`polyline`, :meth:`from_helical`, :meth:`from_bezier`, :meth:`from_contour` or
    :meth:`join`.
    """

    breaks: Float[Array, " n_pieces_plus_one"] = real(unit="m")
    """Arc length at the start of each piece, and at the end of the last."""
    origin: Float[Array, "n_pieces n_axes"] = real(unit="m")
    tangent_vector: Float[Array, "n_pieces n_axes"] = real()
    normal_vector: Float[Array, "n_pieces n_axes"] = real()
    axial_vector: Float[Array, "n_pieces n_axes"] = real()
    angle_rate: Float[Array, " n_pieces"] = real(unit="rad/m")
    """Angle turned per arc length; 0 for a line. Bézier pieces hold 0 here."""
    bezier_row: Int[Array, " n_pieces"] = eqx.field(converter=_whole, kw_only=True)
    """Row of the Bézier tables that a piece uses, -1 for a helical piece."""
    control_points: Float[Array, "n_rows degree_plus_one n_axes_plus_one"] = real()
    """Homogeneous control points (w x, w y, ..., w)."""
    inverse_length: Float[Array, "n_rows n_coefficients"] = real()
    """Chebyshev coefficients of u over s/length mapped to [-1, 1]."""
    source_line: Int[Array, " n_pieces"] = eqx.field(converter=_whole, kw_only=True)
    """Line of the part program that made the piece, 0 if unknown."""
    kinds: str = static(allowed=("helical", "bezier", "mixed"))
    """Which kinds of piece there are; decides what is compiled."""
    is_closed: bool = static(flag=True, default=False)

    # -- making -------------------------------------------------------------------------------

    @staticmethod
    def from_helical(
        start: Any,
        tangent_vector: Any,
        normal_vector: Any,
        axial_vector: Any,
        angle_rate: Any,
        length: Any,
        source_line: Any = None,
        *,
        closed: bool = False,
    ) -> Path:
        """Return a path of lines, arcs and helices.

        Parameters
        ----------
        start
            First points, shape (n_pieces, n_axes) [m].
        tangent_vector, normal_vector, axial_vector
            U, V, W of the module's formula, shape (n_pieces, n_axes).
        angle_rate
            Shape (n_pieces,) [rad/m].
        length
            Arc lengths, shape (n_pieces,) [m], > 0.
        source_line
            Shape (n_pieces,), counted from 1; 0 if not given.
        closed
            Whether the end is the start and the parameter goes round.

        Raises
        ------
        GeometryError
            Not finite, a length of 0, pieces that do not meet, or vectors that are no directions.
        """
        start = np.atleast_2d(np.asarray(start, float))
        n, n_axes = start.shape
        u, v, w = (
            np.asarray(vector, float) for vector in (tangent_vector, normal_vector, axial_vector)
        )
        rate, lengths = np.asarray(angle_rate, float), np.asarray(length, float)
        control, inverse = np.zeros((0, 2, n_axes + 1)), np.zeros((0, 1))
        kinds = np.full(n, -1, np.int32)
        return Path(
            **path_fields(
                start, u, v, w, rate, lengths, kinds, control, inverse, source_line, closed
            )
        )

    @staticmethod
    def polyline(points: Any, source_line: Any = None, *, closed: bool = False) -> Path:
        """Return straight lines through points.

        Parameters
        ----------
        points
            Shape (n_points, n_axes) [m]; no two neighbours equal.
        source_line
            Of each line, shape (n_points - 1,), or (n_points,) if closed.
        closed
            Whether the last point is joined to the first.

        Raises
        ------
        GeometryError
            Fewer than two points, NaN, or repeated points.
        """
        points = np.asarray(points, float)
        if points.ndim != 2 or len(points) < 2:
            raise GeometryError(f"a polyline needs two points or more, got shape {points.shape}")
        if closed and not np.array_equal(points[0], points[-1]):
            points = np.concatenate([points, points[:1]])
        steps = np.diff(points, axis=0)
        length = np.linalg.norm(steps, axis=1)
        positive_lengths(length)
        zero = np.zeros_like(steps)
        tangent = steps / length[:, None]
        return Path.from_helical(
            points[:-1], tangent, zero, zero, np.zeros(len(steps)), length, source_line,
            closed=closed,
        )  # fmt: skip

    @staticmethod
    def from_bezier(
        control_points: Any, weights: Any = None, source_line: Any = None, *, closed: bool = False
    ) -> Path:
        """Return rational Bézier curves end to end, exactly.

        Parameters
        ----------
        control_points
            Shape (n_curves, degree + 1, n_axes) [m].
        weights
            Shape (n_curves, degree + 1), > 0; all 1 if not given.
        source_line
            Shape (n_curves,).
        closed
            Whether the end is the start.

        Raises
        ------
        GeometryError
            Weights not positive, a curve whose speed vanishes (a cusp), curves that do not meet.
        """
        points = np.asarray(control_points, float)
        if points.ndim != 3 or points.shape[1] < 2:
            raise GeometryError(
                f"control_points must have shape (n_curves, degree + 1, n_axes), got {points.shape}"
            )
        weights = np.ones(points.shape[:2]) if weights is None else np.asarray(weights, float)
        if weights.shape != points.shape[:2] or not (weights > 0).all():
            raise GeometryError(f"weights must be > 0 and of shape {points.shape[:2]}")
        if not (np.isfinite(points).all() and np.isfinite(weights).all()):
            raise GeometryError("control points and weights must be finite")
        homogeneous = np.concatenate([points * weights[..., None], weights[..., None]], axis=2)
        rows, inverse, length, owner = bezier_rows(homogeneous)
        n, n_axes = len(rows), points.shape[2]
        lines = None if source_line is None else np.asarray(source_line, np.int32)[owner]
        zero = np.zeros((n, n_axes))
        start = rows[:, 0, :-1] / rows[:, 0, -1:]
        return Path(**path_fields(
            start, zero, zero, zero, np.zeros(n), length, np.arange(n, dtype=np.int32),
            rows, inverse, lines, closed,
        ))  # fmt: skip

    @staticmethod
    def join(
        contours: Sequence[Contour], *, tolerance: float | None = None, closed: bool = False
    ) -> Path:
        """Return several contours end to end; :func:`contourlab.contours.join` says how closely.

        Paths enter as they are; lines, arcs, circles, helices, ellipses, B-splines and NURBS
        exactly; any other contour within a tolerance, which must then be given.

        Parameters
        ----------
        contours
            Each begins where the one before ends.
        tolerance
            Greatest distance from contours that a path cannot hold exactly, > 0 [m].
        closed
            Whether the end of the last is the start of the first.

        Raises
        ------
        GeometryError
            None given, different numbers of axes, ends that do not meet, a tolerance that is
            missing or cannot be met.
        """
        from contourlab.contours.joining import join  # which makes paths

        return join(contours, tolerance=tolerance, closed=closed).path

    @staticmethod
    def from_contour(contour: Contour, tolerance: float) -> Path:
        """Return a contour as a path, of which the parameter is arc length.

        Lines, arcs, circles, helices, ellipses, B-splines and NURBS enter exactly (to rounding).
        Any other contour is followed by quintic Bézier curves that have its points and first two
        derivatives at their ends; they are made shorter until the distance, measured at 32 places
        on each, is within the tolerance. The contour must be smooth: make one path of each smooth
        stretch, and join them.

        Parameters
        ----------
        contour
            What to follow. A path is returned as it is.
        tolerance
            Greatest distance between the path and the contour, > 0 [m].

        Raises
        ------
        GeometryError
            A tolerance that is not > 0 or that cannot be met; a contour that stands still.
        """
        from contourlab.contours.fitting import path_from_contour  # which makes paths

        return path_from_contour(contour, tolerance)

    def piece(self, index: int) -> Path:
        """Return one piece as a path of its own, with its parameter starting at 0.

        Parameters
        ----------
        index
            0 to n_pieces - 1; negative counts from the end.

        Raises
        ------
        GeometryError
            No such piece.
        """
        if not -self.n_pieces <= index < self.n_pieces:
            raise GeometryError(f"piece must be in 0 .. {self.n_pieces - 1}, got {index}")
        at = slice(index % self.n_pieces, index % self.n_pieces + 1)
        row = int(self.bezier_row[at][0])
        used = slice(row, row + 1) if row >= 0 else slice(0, 0)
        return Path(**path_fields(
            np.asarray(self.origin)[at], np.asarray(self.tangent_vector)[at],
            np.asarray(self.normal_vector)[at], np.asarray(self.axial_vector)[at],
            np.asarray(self.angle_rate)[at], np.diff(self.breaks)[at],
            np.array([0 if row >= 0 else -1], np.int32), np.asarray(self.control_points)[used],
            np.asarray(self.inverse_length)[used], np.asarray(self.source_line)[at], False,
        ))  # fmt: skip

    # -- asking -------------------------------------------------------------------------------

    @property
    def n_axes(self) -> int:
        """Number of coordinates."""
        return int(self.origin.shape[-1])

    @property
    def n_pieces(self) -> int:
        """Number of pieces."""
        return int(self.origin.shape[-2])

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """Start and end of the parameter: 0 and the length [m]."""
        return self.breaks[0], self.breaks[-1]

    @property
    def closed(self) -> bool:
        """Whether the end is the start."""
        return self.is_closed

    @property
    def length(self) -> Scalar:
        """Length [m]."""
        return self.breaks[-1] - self.breaks[0]

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m]: their difference.

        Parameters
        ----------
        start, end
            Parameters.
        """
        return end - start

    def find(self, parameter: Scalar) -> Count:
        """Return the piece that holds a parameter, by bisection; right-sided at joints.

        Parameters
        ----------
        parameter
            One scalar; wrapped on a closed path.
        """
        at = self.wrap(parameter) if self.closed else parameter
        index = jnp.searchsorted(jnp.asarray(self.breaks[1:-1]), at, side="right")
        return index.astype(jnp.int32)

    def locate(self, parameter: Scalar, piece: Count) -> Count:
        """Return the piece that holds a parameter, walking from another piece.

        Parameters
        ----------
        parameter
            One scalar; wrapped on a closed path.
        piece
            Where to start, int32.
        """
        at = jax.lax.stop_gradient(self.wrap(parameter) if self.closed else parameter)
        breaks = jax.lax.stop_gradient(jnp.asarray(self.breaks))
        last = self.n_pieces - 1

        def ahead(k: Any) -> Any:
            return (k < last) & (at >= breaks[k + 1])

        def behind(k: Any) -> Any:
            return (k > 0) & (at < breaks[k])

        index = jnp.clip(jnp.asarray(piece, jnp.int32), 0, last)
        index = jax.lax.while_loop(ahead, lambda k: k + 1, index)
        return jax.lax.while_loop(behind, lambda k: k - 1, index)

    def position(self, parameter: Scalar, piece: Count | None = None) -> AxisVector:
        """Return the point at one arc length, shape (n_axes,) [m].

        Parameters
        ----------
        parameter
            Arc length [m].
        piece
            As from ``locate``; looked up when None.
        """
        return self.derivatives(parameter, 0, piece)[0]

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over arc length.

        Parameters
        ----------
        parameter
            Arc length [m].
        order
            Highest derivative, >= 0.
        piece
            As from ``locate``; looked up when None.

        Returns
        -------
        Derivatives
            Shape (order + 1, n_axes) [m^(1-k)]; right-sided at joints.
        """
        if order < 0:
            raise GeometryError(f"order must be >= 0, got {order}")
        k = self.find(parameter) if piece is None else piece
        at = self.wrap(parameter) if self.closed else parameter
        breaks = jnp.asarray(self.breaks)
        s = at - breaks[k]
        if self.kinds != "bezier":
            helical = helical_derivatives(
                s,
                jnp.asarray(self.angle_rate)[k],
                jnp.asarray(self.origin)[k],
                jnp.asarray(self.tangent_vector)[k],
                jnp.asarray(self.normal_vector)[k],
                jnp.asarray(self.axial_vector)[k],
                order,
            )
            if self.kinds == "helical":
                return helical
        kind = jnp.asarray(self.bezier_row)[k]
        row = jnp.maximum(kind, 0)
        control, inverse = (
            jnp.asarray(self.control_points)[row],
            jnp.asarray(self.inverse_length)[row],
        )
        curve = bezier_derivatives(control, inverse, breaks[k + 1] - breaks[k], s, order)
        return curve if self.kinds == "bezier" else jnp.where(kind >= 0, curve, helical)

    def source_line_at(self, parameter: Scalar, piece: Count | None = None) -> Count:
        """Return the line of the part program that made the path at a parameter, 0 if unknown.

        Parameters
        ----------
        parameter
            Arc length [m].
        piece
            As from ``locate``; looked up when None.
        """
        k = self.find(parameter) if piece is None else piece
        return jnp.asarray(self.source_line)[k]

    @property
    def curvature(self) -> Float[NDArray[Any], " n_pieces"]:
        """Curvature of each helical piece [1/m], 0 for a line.

        NaN for a Bézier piece, where it varies. In the plane it is signed, positive for a left
        turn.
        """
        u, v = np.asarray(self.tangent_vector), np.asarray(self.normal_vector)
        if self.n_axes == 2:
            size = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
            curvature = np.asarray(self.angle_rate) * size
        else:
            curvature = np.abs(self.angle_rate) * np.linalg.norm(u, axis=1)
        return np.where(np.asarray(self.bezier_row) >= 0, np.nan, curvature)

    def joints(self) -> Joints:
        """Return the joints between the pieces, the seam of a closed path last."""
        return path_joints(self)

    def corners(self, tolerance: float = CORNER) -> Int[NDArray[Any], " n_corners"]:
        """Return the joints at which the path turns by more than an angle, in order.

        Parameters
        ----------
        tolerance
            Angle [rad].
        """
        return np.flatnonzero(self.joints().turning_angle > tolerance)
