"""Circles and circular arcs, in the plane and in space."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import real, static
from contourlab.contours.base import ClosedFormContour, left_normal, unit
from contourlab.contours.level import Level, quadratic_level
from contourlab.errors import GeometryError
from contourlab.typing import Array, AxisVector, Count, Derivatives, Scalar

__all__ = ["Arc", "Circle", "plane_axes", "turning"]

TURN = 2.0 * np.pi

_PLANE_TOLERANCE = 1e-9
"""How far an arc's start may be out of its plane, as a fraction of the radius."""


def turning(first: AxisVector, second: AxisVector, angle: Scalar, order: int) -> list[AxisVector]:
    """Return ``first cos(angle) + second sin(angle)`` and its derivatives over the angle.

    Parameters
    ----------
    first, second
        Shape (n_axes,) [m].
    angle
        One scalar [rad].
    order
        Highest derivative, >= 0.
    """
    if order < 0:
        raise GeometryError(f"order must be >= 0, got {order}")
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    value, slope = first * cosine + second * sine, second * cosine - first * sine
    quarter_turns = (value, slope, -value, -slope)
    return [quarter_turns[k % 4] for k in range(order + 1)]


def plane_axes(normal: AxisVector) -> tuple[AxisVector, AxisVector]:
    """Return two unit vectors that span the plane of a normal, right-handed with it.

    The first is the coordinate axis that follows, in the cycle x y z, the one most aligned with the
    normal, made perpendicular to the normal. So the planes of G-code come out as they are used:
    normal z gives x and y (G17), normal y gives z and x (G18), normal x gives y and z (G19).

    Parameters
    ----------
    normal
        Shape (3,), of any length > 0.
    """
    normal = unit(jnp.asarray(normal))
    axis = jnp.eye(3)[(jnp.argmax(jnp.abs(normal)) + 1) % 3]
    first = unit(axis - normal * (normal @ axis))
    return first, jnp.cross(normal, first)


def check_plane(center: Array, normal: Array | None) -> None:
    """Raise GeometryError unless a centre and a normal describe one plane."""
    n_axes = center.shape[-1] if center.ndim else 0
    if n_axes not in (2, 3):
        raise GeometryError(f"center must have 2 or 3 coordinates, got shape {center.shape}")
    if n_axes == 2 and normal is not None:
        raise GeometryError("normal is for circles in space: center has 2 coordinates")
    if n_axes == 3:
        if normal is None:
            raise GeometryError(
                "a circle in space needs normal=(x, y, z): center has 3 coordinates"
            )
        check_direction("normal", normal)


def check_direction(name: str, vector: Array) -> None:
    """Raise GeometryError unless a vector has three coordinates and a length."""
    if vector.ndim == 0 or vector.shape[-1] != 3:
        raise GeometryError(f"{name} must have 3 coordinates, got shape {vector.shape}")
    if not np.all(np.linalg.norm(vector, axis=-1) > 0.0):
        raise GeometryError(f"{name} must not be the zero vector")


class Circle(ClosedFormContour):
    """A full circle; the parameter is the angle from its start [rad], 0 to 2π, and goes round.

    In the plane the angle is counted from the x axis. In space it is counted from the first of
    :func:`plane_axes`, counter-clockwise as seen from the tip of the normal.

    Parameters
    ----------
    radius
        > 0 [m].
    center
        Shape (2,) for a circle in the plane, (3,) for one in space [m].
    normal
        In space: the direction perpendicular to the circle, of any length.
    clockwise
        Whether the circle runs the other way.
    start_angle
        Where on the circle the parameter is 0 [rad], always counted counter-clockwise.

    Raises
    ------
    GeometryError
        A centre of neither 2 nor 3 coordinates; a normal that is missing, superfluous or zero.
    ConfigurationError
        A radius that is not > 0; a number that is not finite.
    """

    radius: Float[Array, " ..."] = real(unit="m", above=0.0, ndim=0)
    center: Float[Array, "... n_axes"] = real(unit="m", ndim=1, default=(0.0, 0.0))
    normal: Float[Array, "... 3"] | None = real(ndim=1, default=None)
    clockwise: bool = static(flag=True, default=False)
    start_angle: Float[Array, " ..."] = real(unit="rad", ndim=0, default=0.0)

    def check(self) -> None:
        """Raise GeometryError unless centre and normal describe one plane."""
        check_plane(self.center, self.normal)

    @property
    def n_axes(self) -> int:
        """2 or 3."""
        return int(self.center.shape[-1])

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """0 and 2π [rad]."""
        return 0.0, TURN

    @property
    def closed(self) -> bool:
        """Always."""
        return True

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m]: the radius times their difference.

        Parameters
        ----------
        start, end
            Parameters [rad].
        """
        return self.radius * (end - start)

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the angle, in closed form.

        Parameters
        ----------
        parameter
            Angle from the start [rad].
        order
            Highest derivative, >= 0.
        piece
            Not needed.

        Returns
        -------
        Derivatives
            Shape (order + 1, n_axes) [m/rad^k].
        """
        del piece
        x, y = jnp.eye(2) if self.normal is None else plane_axes(self.normal)
        cosine, sine = jnp.cos(self.start_angle), jnp.sin(self.start_angle)
        first = self.radius * (x * cosine + y * sine)
        second = self.radius * (y * cosine - x * sine)
        rows = turning(first, -second if self.clockwise else second, parameter, order)
        return jnp.stack([self.center + rows[0], *rows[1:]])

    @property
    def has_level(self) -> bool:
        """Whether the circle is planar."""
        return self.n_axes == 2

    def level_derivatives(self, position: AxisVector) -> Level:
        """Return the implicit form ±(|p - center|² / radius² - 1), its gradient and its Hessian.

        0 on the circle, > 0 on the right of the direction of travel: outside, or inside if the
        circle is clockwise.

        Parameters
        ----------
        position
            Shape (2,) [m].

        Raises
        ------
        GeometryError
            The circle is not planar.
        """
        if self.n_axes != 2:
            raise GeometryError("only a planar circle has an implicit form")
        return quadratic_level(
            jnp.asarray(position) - self.center, jnp.eye(2) / self.radius, jnp.zeros(2),
            jnp.asarray(-1.0), -1.0 if self.clockwise else 1.0,
        )  # fmt: skip


class Arc(ClosedFormContour):
    """A circular arc; the parameter is the angle swept from its start [rad], 0 to abs(angle).

    Beyond its ends the arc goes on round its circle.

    Parameters
    ----------
    center
        Shape (2,) for an arc in the plane, (3,) for one in space [m].
    start
        First point, of as many coordinates [m].
    angle
        Swept angle, not 0 [rad]: > 0 counter-clockwise, < 0 clockwise, in space as seen from the
        tip of the normal. More than a turn is allowed.
    normal
        In space: the direction perpendicular to the arc, of any length.

    Raises
    ------
    GeometryError
        Points of neither 2 nor 3 coordinates; a normal that is missing, superfluous or zero; a
        start at the centre or out of the plane; an angle of 0.
    ConfigurationError
        A number that is not finite.
    """

    center: Float[Array, "... n_axes"] = real(unit="m", ndim=1)
    start: Float[Array, "... n_axes_of_start"] = real(unit="m", ndim=1)
    angle: Float[Array, " ..."] = real(unit="rad", ndim=0)
    normal: Float[Array, "... 3"] | None = real(ndim=1, default=None)

    def check(self) -> None:
        """Raise GeometryError unless the numbers describe an arc."""
        center, start = np.asarray(self.center), np.asarray(self.start)
        check_plane(center, self.normal)
        if start.ndim == 0 or start.shape[-1] != center.shape[-1]:
            raise GeometryError(
                "center and start must be points with the same number of axes, "
                f"got shapes {center.shape} and {start.shape}"
            )
        radius = np.linalg.norm(start - center, axis=-1)
        if not np.all(radius > 0.0):
            raise GeometryError("an arc needs a radius > 0 m: start and center are the same point")
        if not np.all(self.angle != 0.0):
            raise GeometryError("angle must not be 0 rad")
        if self.normal is not None:
            normal = np.asarray(self.normal)
            height = np.abs(np.sum((start - center) * normal, axis=-1))
            height = height / np.linalg.norm(normal, axis=-1)
            if not np.all(height <= _PLANE_TOLERANCE * radius):
                raise GeometryError(
                    f"start is {np.max(height):.3g} m out of the plane through center "
                    "perpendicular to normal"
                )

    @property
    def n_axes(self) -> int:
        """2 or 3."""
        return int(self.center.shape[-1])

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """0 and the angle's size [rad]."""
        return 0.0, jnp.abs(self.angle)

    @property
    def closed(self) -> bool:
        """Never: use a :class:`Circle`."""
        return False

    @property
    def radius(self) -> Scalar:
        """Distance of the start from the centre [m]."""
        arm = jnp.asarray(self.start) - jnp.asarray(self.center)
        return jnp.sqrt(arm @ arm)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m]: the radius times their difference.

        Parameters
        ----------
        start, end
            Parameters [rad].
        """
        return self.radius * (end - start)

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the angle, in closed form.

        Parameters
        ----------
        parameter
            Angle from the start [rad].
        order
            Highest derivative, >= 0.
        piece
            Not needed.

        Returns
        -------
        Derivatives
            Shape (order + 1, n_axes) [m/rad^k].
        """
        del piece
        arm = jnp.asarray(self.start) - jnp.asarray(self.center)
        if self.normal is None:
            across = left_normal(arm)
        else:
            across = jnp.cross(unit(jnp.asarray(self.normal)), arm)
        rows = turning(arm, across * jnp.sign(self.angle), parameter, order)
        return jnp.stack([self.center + rows[0], *rows[1:]])
