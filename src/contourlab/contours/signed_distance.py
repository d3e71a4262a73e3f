"""Implicit forms for use in a loop: a contour's own, or the signed distance from any planar one.

With the foot point r on the piece of contour near a reference parameter, e = r - p the contour
error vector, n the left normal and κ the signed curvature at the foot, the value is f = e . n, the
contour error itself. Moving p along n changes f by -1, and moving it along the tangent t by ds
turns the normal at the foot by κ ds / (1 + κ f), so that

    ∇f = -n,    ∇∇f = κ / (1 + κ f) t tᵀ

On the evolute, 1 + κ f = 0, the foot is no longer unique and the Hessian is not finite; it is held
at the value for 1 + κ f = 1e-9. Where the foot is a corner or an end c of the contour, f is
±|p - c|, ∇f = -e / f and ∇∇f = (1 - ∇f ∇fᵀ) / f.

|∇f| = 1 everywhere, so that the contour error f / |∇f| of a global task frame is exact here.
"""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp

from contourlab.contours.base import Contour, left_normal, unit
from contourlab.contours.foot_points import local_foot
from contourlab.contours.foot_points.cells import Cells
from contourlab.contours.foot_points.contour_cells import cells_of
from contourlab.contours.level import Level
from contourlab.errors import GeometryError
from contourlab.typing import AxisVector, Count, Scalar

__all__ = ["ImplicitForm", "SignedDistance", "implicit_form"]

_FOCAL = 1e-9
"""1 + κ f is held above this."""
_PERPENDICULAR = 1e-6
"""The error vector of a foot inside a piece is perpendicular to the tangent to this fraction."""


class ImplicitForm(eqx.Module):
    """A function of the position that is zero on a contour, positive on the right of its travel.

    Made by :func:`implicit_form`.
    """

    def level(self, position: AxisVector, near: Scalar, piece: Count | None = None) -> Scalar:
        """Return the value alone.

        Parameters
        ----------
        position, near, piece
            As of ``level_derivatives``.
        """
        return self.level_derivatives(position, near, piece).value

    @abc.abstractmethod
    def level_derivatives(
        self, position: AxisVector, near: Scalar, piece: Count | None = None
    ) -> Level:
        """Return the value, its gradient and its Hessian.

        Parameters
        ----------
        position
            Shape (2,) [m].
        near
            Reference parameter, near which the contour is meant.
        piece
            Where to look for ``near`` first, as in ``contour.locate``.
        """


class OwnForm(ImplicitForm):
    """The form that a contour has in closed form; it is the same near every parameter."""

    contour: Contour

    def level_derivatives(
        self, position: AxisVector, near: Scalar, piece: Count | None = None
    ) -> Level:
        """Return the value, its gradient and its Hessian.

        Parameters
        ----------
        position
            Shape (2,) [m].
        near, piece
            Not needed.
        """
        del near, piece
        return self.contour.level_derivatives(position)


def implicit_form(contour: Contour) -> ImplicitForm:
    """Return a contour's own implicit form where it has one, else the signed distance from it.

    Parameters
    ----------
    contour
        Any planar contour.

    Raises
    ------
    GeometryError
        A contour that is not planar.
    """
    if contour.has_level:
        return OwnForm(contour)
    return SignedDistance(contour)


class SignedDistance(ImplicitForm):
    """The contour error as a function of the position: an implicit form of any planar contour.

    Traceable, for use inside a loop; make it once before the loop. Exact at any distance at which
    the foot is unique; its derivatives jump at the foot of a corner and on the evolute's far side,
    where the foot jumps. Unlike a conic's own form it wants a reference parameter, near which the
    foot is looked for, so that the crossing of a figure of eight is no trouble.

    Parameters
    ----------
    contour
        Any planar contour.

    Raises
    ------
    GeometryError
        A contour that is not planar.
    """

    cells: Cells

    def __init__(self, contour: Contour) -> None:
        if contour.n_axes != 2:
            raise GeometryError(
                f"only a planar contour has a signed distance, this one has {contour.n_axes} axes"
            )
        self.cells = cells_of(contour)

    @property
    def contour(self) -> Contour:
        """The contour."""
        return self.cells.contour  # type: ignore[no-any-return]

    def level(self, position: AxisVector, near: Scalar, piece: Count | None = None) -> Scalar:
        """Return the contour error [m]: > 0 on the right of the direction of travel.

        Parameters
        ----------
        position, near, piece
            As of ``level_derivatives``.
        """
        return local_foot(self.cells, position, near, piece).distance  # type: ignore[no-any-return]

    def level_derivatives(
        self, position: AxisVector, near: Scalar, piece: Count | None = None
    ) -> Level:
        """Return the contour error [m], its gradient [1] and its Hessian [1/m].

        Parameters
        ----------
        position
            Shape (2,) [m].
        near
            Reference parameter.
        piece
            Where to look for ``near`` first, as in ``contour.locate``.
        """
        contour = self.contour
        foot = local_foot(self.cells, position, near, piece)
        hint = contour.locate(foot.parameter, jnp.int32(0) if piece is None else piece)
        d = contour.derivatives(foot.parameter, 2, hint)
        tangent = unit(d[1])
        speed2 = d[1] @ d[1]
        safe2 = jnp.where(speed2 > 0.0, speed2, 1.0)
        curvature = (d[1, 0] * d[2, 1] - d[1, 1] * d[2, 0]) / (safe2 * jnp.sqrt(safe2))
        value, vector = foot.distance, foot.vector
        # relative to rounding of the coordinates, below which a direction means nothing
        size2 = vector @ vector
        grain2 = (1e-14) ** 2 * (1e-6 + position @ position)
        along = tangent @ vector
        inside = along * along <= _PERPENDICULAR**2 * size2 + grain2
        focal = jnp.maximum(1.0 + curvature * value, _FOCAL)
        smooth = curvature / focal * tangent[:, None] * tangent
        safe = jnp.where(inside, 1.0, value)
        away = -vector / safe
        cornered = (jnp.eye(2) - away[:, None] * away) / safe
        gradient = jnp.where(inside, -left_normal(tangent), away)
        return Level(value, gradient, jnp.where(inside, smooth, cornered))
