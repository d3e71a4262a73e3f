"""Lissajous curves, in any number of axes."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import real, static
from contourlab.contours.base import ClosedFormContour
from contourlab.contours.circle import TURN
from contourlab.contours.placed import first_row, harmonic
from contourlab.errors import GeometryError
from contourlab.typing import Array, Count, Derivatives, Scalar

__all__ = ["Lissajous"]

_LARGEST_DENOMINATOR = 1000
"""A frequency that is a fraction of whole numbers up to this is taken for that fraction."""

_STILL = 1e-6
"""Cosines that are all below this stand for an end from which the curve runs back."""


def _as_tuple(value: Any) -> Any:
    if not isinstance(value, list | tuple | np.ndarray):
        return value
    return tuple(float(f) if isinstance(f, np.generic) else f for f in value)


class Lissajous(ClosedFormContour):
    """One sine for each axis; the parameter is an angle φ [rad].

    ``x_k = center_k + amplitudes_k sin(frequencies_k φ + phases_k)``. Frequencies that are
    fractions of whole numbers (with denominators up to 1000) have a common period: without
    ``turns`` the curve is closed, and φ runs over one period, from 0 to 2π if the frequencies are
    whole and have no common divisor. With ``turns`` it is open and φ runs from 0 to 2π turns.

    The four-axis contour (cos t, sin t, 0.1 cos 10t, 0.1 sin 10t) has ``frequencies=(1, 1, 10,
    10)`` and ``phases=(π/2, 0, π/2, 0)``.

    Parameters
    ----------
    amplitudes
        Shape (n_axes,) or one for all, > 0 [m].
    frequencies
        Of each axis, two axes or more, > 0; static.
    phases
        Shape (n_axes,) or one for all [rad].
    center
        Shape (n_axes,) or one for all [m].
    turns
        Length of an open curve, in 2π of φ, > 0.

    Raises
    ------
    GeometryError
        Fewer than two frequencies, one that is not > 0, numbers of axes that differ, no common
        period and no turns, or a curve that stops at an end and runs back on itself.
    ConfigurationError
        An amplitude or number of turns that is not > 0; a number that is not finite.
    """

    amplitudes: Float[Array, "... n_amplitudes"] = real(unit="m", above=0.0, ndim=1)
    frequencies: tuple[float, ...] = static(converter=_as_tuple)
    phases: Float[Array, "... n_phases"] = real(unit="rad", ndim=1, default=0.0)
    center: Float[Array, "... n_axes"] = real(unit="m", ndim=1, default=0.0)
    turns: Float[Array, " ..."] | None = real(above=0.0, ndim=0, default=None)

    def check(self) -> None:
        """Raise GeometryError unless the numbers make a smooth curve."""
        if (
            not isinstance(self.frequencies, tuple)
            or len(self.frequencies) < 2
            or not all(isinstance(f, int | float) and 0 < f < math.inf for f in self.frequencies)
        ):
            raise GeometryError(
                f"frequencies must be two or more numbers > 0, got {self.frequencies!r}"
            )
        for name in ("amplitudes", "phases", "center"):
            value = getattr(self, name)
            if value.ndim and value.shape[-1] not in (1, self.n_axes):
                raise GeometryError(
                    f"{name} must be one number or {self.n_axes}, as many as frequencies, "
                    f"got shape {value.shape}"
                )
        if self.turns is None and self.period is None:
            raise GeometryError(
                f"frequencies {self.frequencies} have no common period: give turns for an open "
                "curve"
            )
        self._check_ends()

    def _check_ends(self) -> None:
        """Raise GeometryError where all axes stop at once: the curve runs back from there."""
        end = self.period if self.turns is None else TURN * float(np.max(self.turns))
        assert end is not None
        phases = np.moveaxis(np.atleast_1d(self.phases), -1, 0)
        phases = np.broadcast_to(phases, (self.n_axes, *phases.shape[1:]))
        first = self.frequencies[0]
        stops = np.arange(-2.0, 2.0 * first * end / TURN + 3.0)
        at = (0.25 * TURN + 0.5 * TURN * stops - np.mod(phases[0], TURN)[..., None]) / first
        speed = np.max([
            np.abs(np.cos(frequency * at + np.asarray(phase)[..., None]))
            for frequency, phase in zip(self.frequencies, phases, strict=True)
        ], axis=0)  # fmt: skip
        still = (speed < _STILL) & (at >= -1e-9) & (at <= end + 1e-9)
        if still.any():
            raise GeometryError(
                f"the curve stops at parameter {abs(at[still].flat[0]):.6g} rad and runs back on "
                "itself: change phases, or end it there by turns"
            )

    @property
    def n_axes(self) -> int:
        """As many as frequencies."""
        return len(self.frequencies)

    @property
    def period(self) -> float | None:
        """Period of all axes together [rad], None if there is none."""
        ratios = [Fraction(f).limit_denominator(_LARGEST_DENOMINATOR) for f in self.frequencies]
        if any(float(ratio) != f for ratio, f in zip(ratios, self.frequencies, strict=True)):
            return None
        common = Fraction(
            math.gcd(*(ratio.numerator for ratio in ratios)),
            math.lcm(*(ratio.denominator for ratio in ratios)),
        )
        return TURN / float(common)

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """0 and the period, or 2π turns [rad]."""
        end = self.period if self.turns is None else TURN * self.turns
        assert end is not None
        return 0.0, end

    @property
    def closed(self) -> bool:
        """Whether no turns are given."""
        return self.turns is None

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the angle, in closed form.

        Parameters
        ----------
        parameter
            φ [rad].
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
        if order < 0:
            raise GeometryError(f"order must be >= 0, got {order}")
        n = (self.n_axes,)
        size = jnp.broadcast_to(jnp.asarray(self.amplitudes), n)
        phase = jnp.broadcast_to(jnp.asarray(self.phases), n)
        rows = harmonic(
            0.0 * size, size, jnp.asarray(self.frequencies, float), parameter, order, phase
        )
        return rows + first_row(order) * jnp.broadcast_to(jnp.asarray(self.center), n)
