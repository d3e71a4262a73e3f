"""The Archimedean spiral and the involute of a circle, in the plane, with their arc lengths."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contours.circle import TURN, turning
from contourlab.contours.placed import PlacedContour
from contourlab.errors import ConfigurationError
from contourlab.typing import Array, Derivatives, Scalar

__all__ = ["Involute", "Spiral"]


_ROUNDING = 1e-12
"""A spiral that ends this fraction of its start radius past its centre ends in it."""


class Spiral(PlacedContour):
    """An Archimedean spiral; the parameter is the angle turned φ [rad], 0 to 2π turns.

    Before it is turned and shifted, its distance from the centre is start_radius + c φ, with
    c = pitch / 2π. It turns counter-clockwise and starts on its own x axis. Reversed, or reflected
    by ``scaled((1.0, -1.0))``, it runs the other way.

    Parameters
    ----------
    start_radius
        Distance from the centre at the start, >= 0 [m].
    pitch
        Growth of that distance in one turn, not 0 [m]; < 0 runs inwards, no further than to the
        centre.
    turns
        How many, > 0; any real number.
    center
        Shape (2,) [m].
    rotation
        Angle from the x axis to the start [rad].

    Raises
    ------
    GeometryError
        A centre that is not of 2 coordinates.
    ConfigurationError
        A start radius below 0, a pitch of 0 or one that leads through the centre; a number of turns
        that is not > 0; a number that is not finite.
    """

    start_radius: Float[Array, " ..."] = real(unit="m", minimum=0.0, ndim=0)
    pitch: Float[Array, " ..."] = real(unit="m", ndim=0)
    turns: Float[Array, " ..."] = real(above=0.0, ndim=0)

    def check(self) -> None:
        """Raise ConfigurationError unless it is a spiral on one side of its centre."""
        super().check()
        if not (self.pitch != 0.0).all():
            raise ConfigurationError("pitch must not be 0 m: that is a circle")
        end = self.start_radius + self.pitch * self.turns
        if not (end >= -_ROUNDING * self.start_radius).all():
            raise ConfigurationError(
                f"pitch of {self.pitch} m and {self.turns} turns lead through the centre: the "
                f"radius would end at {end} m"
            )

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """0 and 2π turns [rad]."""
        return 0.0, TURN * self.turns

    @property
    def closed(self) -> bool:
        """Never."""
        return False

    def own_derivatives(self, parameter: Scalar, order: int) -> Derivatives:
        """Return the point and its derivatives over the angle, before it is turned and shifted.

        Parameters
        ----------
        parameter
            φ [rad].
        order
            Highest derivative, >= 0.
        """
        growth = self.pitch / TURN
        radius = self.start_radius + growth * parameter
        x, y = jnp.eye(2)
        arms = turning(x, y, parameter, order)
        rows = [radius * arms[0]]
        rows += [radius * arms[k] + k * growth * arms[k - 1] for k in range(1, order + 1)]
        return jnp.stack(rows)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m], in closed form.

        The integral of sqrt(r² + c²) over φ is (r q + c² asinh(r / |c|)) / 2c with
        q = sqrt(r² + c²). The difference of the first term is taken apart, so that a small pitch
        costs no digits.

        Parameters
        ----------
        start, end
            φ [rad].
        """
        c = self.pitch / TURN
        r1, r2 = self.start_radius + c * start, self.start_radius + c * end
        q1, q2 = jnp.hypot(r1, c), jnp.hypot(r2, c)
        same_side = r1 * r2 > 0.0
        total = jnp.where(same_side, r1 * q1 + r2 * q2, 1.0)
        apart = (end - start) * (r1 + r2) * (r1 * r1 + r2 * r2 + c * c) / total
        moved = jnp.where(same_side, apart, (r2 * q2 - r1 * q1) / c)
        size = jnp.abs(c)
        return 0.5 * (moved + c * (jnp.arcsinh(r2 / size) - jnp.arcsinh(r1 / size)))


class Involute(PlacedContour):
    """The involute of a circle; the parameter is the angle unwound φ [rad].

    Before it is turned and shifted, it is base_radius (cos φ + φ sin φ, sin φ - φ cos φ): the end
    of a string unwound from the circle, begun at φ = 0 on its own x axis. It turns
    counter-clockwise; its curvature is 1 / (base_radius φ), so that it has a cusp on the circle
    itself and starts beyond it.

    Parameters
    ----------
    base_radius
        Of the circle, > 0 [m].
    start_angle
        φ at the start, > 0 [rad].
    end_angle
        φ at the end, above the first [rad].
    center
        Of the circle, shape (2,) [m].
    rotation
        Angle from the x axis to where the involute leaves the circle [rad].

    Raises
    ------
    GeometryError
        A centre that is not of 2 coordinates.
    ConfigurationError
        A radius or angle that is not > 0; an end that is not above the start; a number that is not
        finite.
    """

    base_radius: Float[Array, " ..."] = real(unit="m", above=0.0, ndim=0)
    start_angle: Float[Array, " ..."] = real(unit="rad", above=0.0, ndim=0)
    end_angle: Float[Array, " ..."] = real(unit="rad", above=0.0, ndim=0)

    def check(self) -> None:
        """Raise ConfigurationError unless the end is beyond the start."""
        super().check()
        if not (self.end_angle > self.start_angle).all():
            raise ConfigurationError(
                f"end_angle must be > start_angle, got {self.end_angle} rad "
                f"and {self.start_angle} rad"
            )

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """Angles of start and end [rad]."""
        return self.start_angle, self.end_angle

    @property
    def closed(self) -> bool:
        """Never."""
        return False

    def own_derivatives(self, parameter: Scalar, order: int) -> Derivatives:
        """Return the point and its derivatives over the angle, before it is turned and shifted.

        Parameters
        ----------
        parameter
            φ [rad].
        order
            Highest derivative, >= 0.
        """
        x, y = jnp.eye(2) * self.base_radius
        arms = turning(x, y, parameter, order)
        # the first derivative is φ times the direction; the others follow by the product rule
        rows = [arms[0] - parameter * turning(x, y, parameter, 1)[1]]
        for k in range(1, order + 1):
            row = parameter * arms[k - 1]
            rows.append(row + (k - 1) * arms[k - 2] if k >= 2 else row)
        return jnp.stack(rows)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m]: base_radius (end² - start²) / 2.

        Parameters
        ----------
        start, end
            φ [rad].
        """
        return 0.5 * self.base_radius * (end - start) * (end + start)
