"""Rotation-minimising frames: normals that turn with the tangent and no further.

The Frenet normal of a spatial contour does not exist where the curvature vanishes, jumps by 180° at
an inflection, and turns fast near one. A rotation-minimising frame has none of this: it needs only
the tangent. Its normals u1, u2 do not turn about the tangent, and the contour's curvature vector is
k1 u1 + k2 u2 with two *signed* curvatures: the curvature is hypot(k1, k2), and seen from the Frenet
frame u1 turns at the rate -τ over arc length.

From point to point the normal is carried by double reflection: in the plane halfway between the
points, then in the plane that brings the reflected tangent onto the next one. The error of one step
is of fifth order in its length, that of a stretch of fourth; on a straight line or a circle there
is none. It is plain arithmetic, for any number of axes, and can go on for ever: every step makes
the normal perpendicular and of length 1 again.

In the plane the carried normal is the left normal, if it was at the start.

References
----------
.. [WangJuttlerZhengLiu2008] the double reflection method; equation numbers not checked.

Differences from the paper
--------------------------
Where the two points are the same (at a corner, or at rest) the paper's first reflection does not
exist; here it is in the plane perpendicular to the tangent, which makes the step the smallest
rotation from one tangent to the other. A tangent that turns straight back leaves the normal as it
is.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from contourlab.contours.base import Contour, left_normal, unit
from contourlab.errors import GeometryError
from contourlab.typing import Array, AxisVector, Derivatives

__all__ = [
    "MovingFrame",
    "TransportedFrame",
    "begin_frame",
    "move_frame",
    "rotation_minimising_frames",
    "transport_normal",
]


class TransportedFrame(NamedTuple):
    """What a loop keeps from one instant to the next: where the frame is."""

    point: AxisVector
    """Shape (n_axes,) [m]."""
    tangent: AxisVector
    """Shape (n_axes,)."""
    normal: AxisVector
    """u1, shape (n_axes,)."""


class MovingFrame(NamedTuple):
    """A rotation-minimising frame, or one in each row."""

    tangent: Array
    """Shape (n_axes,) or (n, n_axes), as the others."""
    normal: Array
    """u1."""
    binormal: Array | None
    """u2 = tangent x u1; None in the plane."""
    curvature: Array
    """k1, along u1 [1/m]; in the plane the signed curvature."""
    second_curvature: Array | None
    """k2, along u2 [1/m]; None in the plane."""


def transport_normal(
    normal: AxisVector,
    point: AxisVector,
    tangent: AxisVector,
    next_point: AxisVector,
    next_tangent: AxisVector,
) -> AxisVector:
    """Return the normal at the next point, carried there without turning about the tangent.

    Parameters
    ----------
    normal
        At the first point, a unit vector perpendicular to its tangent.
    point, next_point
        Shape (n_axes,) [m].
    tangent, next_tangent
        Unit tangents there.
    """
    step = next_point - point
    squared = step @ step
    still = squared == 0.0
    first = jnp.where(still, tangent, step)
    first_squared = jnp.where(still, 1.0, squared)
    turned = normal - 2.0 / first_squared * (first @ normal) * first
    reflected = tangent - 2.0 / first_squared * (first @ tangent) * first
    second = next_tangent - reflected
    second_squared = second @ second
    # 0 where the tangent has turned straight back: the second plane is then any
    none = second_squared <= 1e-30
    carried = (
        turned
        - jnp.where(none, 0.0, 2.0 / jnp.where(none, 1.0, second_squared))
        * (second @ turned)
        * second
    )
    carried = carried - (next_tangent @ carried) * next_tangent
    return unit(carried)


def begin_frame(
    derivatives: Derivatives, normal: AxisVector | None = None
) -> tuple[TransportedFrame, MovingFrame]:
    """Return the frame at a first point.

    Parameters
    ----------
    derivatives
        Of the contour to order 2 or more, over any parameter, shape (>= 3, n_axes).
    normal
        Where u1 shall point; made perpendicular to the tangent. When None it is the left normal in
        the plane; in space the direction of the curvature vector, or where that vanishes the
        coordinate axis least aligned with the tangent, made perpendicular.

    Raises
    ------
    GeometryError
        Neither 2 nor 3 axes.
    """
    tangent = unit(derivatives[1])
    if derivatives.shape[1] not in (2, 3):
        raise GeometryError(
            f"a moving frame needs 2 or 3 axes, this contour has {derivatives.shape[1]}"
        )
    if normal is None:
        normal = _first_normal(derivatives, tangent)
    else:
        normal = unit(normal - tangent * (tangent @ normal))
    kept = TransportedFrame(derivatives[0], tangent, normal)
    return kept, _seen(derivatives, tangent, normal)


def move_frame(
    kept: TransportedFrame, derivatives: Derivatives
) -> tuple[TransportedFrame, MovingFrame]:
    """Return the frame at the next point; one step of a loop.

    Parameters
    ----------
    kept
        What ``begin_frame`` or the step before returned.
    derivatives
        Of the contour to order 2 or more at the next point, over any parameter. Where the contour
        stands still (its first derivative is zero) the tangent stays as it was.
    """
    moving = derivatives[1] @ derivatives[1] > 0.0
    tangent = jnp.where(moving, unit(derivatives[1]), kept.tangent)
    normal = transport_normal(kept.normal, kept.point, kept.tangent, derivatives[0], tangent)
    return TransportedFrame(derivatives[0], tangent, normal), _seen(derivatives, tangent, normal)


def rotation_minimising_frames(
    contour: Contour, parameters: Any, normal: Any = None
) -> MovingFrame:
    """Return rotation-minimising frames along a contour.

    Parameters
    ----------
    contour
        Of 2 or 3 axes.
    parameters
        Where, in the order in which the frame is carried, shape (n,). Its error falls with the
        fourth power of their spacing.
    normal
        Where u1 shall point at the first parameter, shape (n_axes,); see :func:`begin_frame`.

    Returns
    -------
    MovingFrame
        Of NumPy arrays, shape (n, n_axes) and (n,).

    Raises
    ------
    GeometryError
        Parameters of a wrong shape or not finite; a contour of neither 2 nor 3 axes; a normal of a
        wrong shape, or along the tangent.
    """
    places = np.asarray(parameters, float)
    if places.ndim != 1 or not len(places):
        raise GeometryError(f"parameters must have shape (n,), got {places.shape}")
    if not np.isfinite(places).all():
        raise GeometryError("parameters must be finite")
    if contour.n_axes not in (2, 3):
        raise GeometryError(f"a moving frame needs 2 or 3 axes, this contour has {contour.n_axes}")
    if normal is not None:
        normal = np.asarray(normal, float)
        if normal.shape != (contour.n_axes,) or not np.isfinite(normal).all():
            raise GeometryError(
                f"normal must be finite and have {contour.n_axes} coordinates, got {normal}"
            )
        tangent = np.asarray(unit(contour.derivatives(jnp.asarray(places[0]), 1)[1]))
        across = np.linalg.norm(normal - tangent * (tangent @ normal))
        if not across > 1e-9 * np.linalg.norm(normal):
            raise GeometryError(f"normal must not be along the tangent, got {normal}")
    return jax.tree.map(np.asarray, _carried(contour, places, normal))  # type: ignore[no-any-return]


@eqx.filter_jit
def _carried(contour: Contour, places: Array, normal: Array | None) -> MovingFrame:
    rows = jax.vmap(lambda p: contour.derivatives(p, 2))(jnp.asarray(places))
    kept, first = begin_frame(rows[0], normal)

    def step(kept: TransportedFrame, row: Any) -> tuple[TransportedFrame, MovingFrame]:
        return move_frame(kept, row)

    _, others = jax.lax.scan(step, kept, rows[1:])
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, others)  # type: ignore[no-any-return]


def _seen(derivatives: Derivatives, tangent: AxisVector, normal: AxisVector) -> MovingFrame:
    speed2 = derivatives[1] @ derivatives[1]
    still = speed2 == 0.0
    bend = jnp.where(still, 0.0, derivatives[2]) / jnp.where(still, 1.0, speed2)
    if derivatives.shape[1] == 2:
        return MovingFrame(tangent, normal, None, bend @ normal, None)
    binormal = jnp.cross(tangent, normal)
    return MovingFrame(tangent, normal, binormal, bend @ normal, bend @ binormal)


def _first_normal(derivatives: Derivatives, tangent: AxisVector) -> AxisVector:
    if derivatives.shape[1] == 2:
        return left_normal(tangent)
    bend = derivatives[2] - tangent * (tangent @ derivatives[2])
    axis = jnp.eye(3)[jnp.argmin(jnp.abs(tangent))]
    perpendicular = axis - tangent * (tangent @ axis)
    straight = bend @ bend <= 1e-24 * (derivatives[2] @ derivatives[2])
    return unit(jnp.where(straight, perpendicular, bend))
