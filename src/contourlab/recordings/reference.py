"""What the machine is asked to do: one point of the path, and more, at every sample.

A reference is the end of planning. Position, velocity, acceleration and jerk live in *axes*; the
contour, its parameter and whatever is derived from it live in the space of the *tool*. For most
machines the two are the same.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from contourlab.configuration import Configuration, part, real, static
from contourlab.contours.base import Contour
from contourlab.errors import ConfigurationError
from contourlab.typing import Array, AxisVector, Record, Scalar, Series

__all__ = ["Reference", "ReferencePoint"]


class ReferencePoint(eqx.Module):
    """The reference at one instant (or, with a leading dimension, at several)."""

    parameter: Float[Array, "*batch"]
    """Contour parameter."""
    parameter_rate: Float[Array, "*batch"]
    """Its first time derivative [per s]."""
    parameter_acceleration: Float[Array, "*batch"]
    """Its second time derivative [per s²]."""
    position: Float[Array, "*batch n_axes"]
    """Axis positions [m]."""
    velocity: Float[Array, "*batch n_axes"]
    """Axis velocities [m/s]."""
    acceleration: Float[Array, "*batch n_axes"]
    """Axis accelerations [m/s²]."""
    jerk: Float[Array, "*batch n_axes"]
    """Axis jerks [m/s³]."""


class Reference(Configuration):
    """A record of reference points, one per sample; past its end it rests at its last point.

    Where a planned derivative jumps at a sampling instant, the record holds the value to the right
    of the jump.
    """

    sample_time: Scalar = real(unit="s", above=0.0)
    parameter: Series = real()
    parameter_rate: Series = real(unit="1/s")
    parameter_acceleration: Series = real(unit="1/s^2")
    position: Record = real(unit="m")
    velocity: Record = real(unit="m/s")
    acceleration: Record = real(unit="m/s^2")
    jerk: Record = real(unit="m/s^3")
    contour: Contour = part()
    warnings: tuple[str, ...] = static(default=())
    """What the plan could not honour, in sentences."""
    motion_warnings: tuple[str, ...] = static(default=())
    """Those of them that tell how it moves: of no concern to a law that plans its own time."""

    def check(self) -> None:
        """Check that all records have one shape."""
        n = np.shape(self.parameter)[-1]
        if n < 2:
            raise ConfigurationError(f"a reference needs two samples or more, got {n}")
        for name in ("parameter_rate", "parameter_acceleration"):
            if np.shape(getattr(self, name)) != np.shape(self.parameter):
                raise ConfigurationError(
                    f"{name} must have shape {np.shape(self.parameter)}, "
                    f"got {np.shape(getattr(self, name))}"
                )
        for name in ("position", "velocity", "acceleration", "jerk"):
            shape = np.shape(getattr(self, name))
            if len(shape) < 2 or shape[-2] != n or shape != np.shape(self.position):
                raise ConfigurationError(f"{name} must have shape ({n}, n_axes), got {shape}")

    @staticmethod
    def along(
        contour: Contour,
        *,
        sample_time: float,
        parameter: Any,
        parameter_rate: Any,
        parameter_acceleration: Any,
        parameter_jerk: Any,
        warnings: tuple[str, ...] = (),
        motion_warnings: tuple[str, ...] = (),
    ) -> Reference:
        """Return the reference of a point that runs along a contour, axes being coordinates.

        Parameters
        ----------
        contour
            The path.
        sample_time
            Time between samples [s].
        parameter, parameter_rate, parameter_acceleration, parameter_jerk
            The contour parameter and its time derivatives at each sample, shape (n_samples,).
        warnings
            What the plan could not honour.
        motion_warnings
            Those of them that tell how it moves.

        Raises
        ------
        ConfigurationError
            Profiles of different shapes, or of less than two samples.
        """
        profile = {
            "parameter": np.asarray(parameter, float),
            "parameter_rate": np.asarray(parameter_rate, float),
            "parameter_acceleration": np.asarray(parameter_acceleration, float),
            "parameter_jerk": np.asarray(parameter_jerk, float),
        }
        shape = (profile["parameter"].size,)
        for name, row in profile.items():
            if row.shape != shape:
                raise ConfigurationError(f"{name} must have shape {shape}, got {row.shape}")
        rows = _in_blocks(contour, list(profile.values()))
        return Reference(
            sample_time=sample_time, parameter=parameter, parameter_rate=parameter_rate,
            parameter_acceleration=parameter_acceleration, position=rows[0], velocity=rows[1],
            acceleration=rows[2], jerk=rows[3], contour=contour, warnings=warnings,
            motion_warnings=motion_warnings,
        )  # fmt: skip

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(np.shape(self.parameter)[-1])

    @property
    def n_axes(self) -> int:
        """Number of axes (which may differ from the contour's coordinates)."""
        return int(np.shape(self.position)[-1])

    @property
    def time(self) -> Series:
        """Sampling instants from 0 [s], shape (n_samples,)."""
        return np.arange(self.n_samples) * np.asarray(self.sample_time)  # type: ignore[no-any-return]

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float((self.n_samples - 1) * np.asarray(self.sample_time))

    @property
    def points(self) -> ReferencePoint:
        """All points, each array with a leading dimension of n_samples."""
        return ReferencePoint(
            self.parameter, self.parameter_rate, self.parameter_acceleration,
            self.position, self.velocity, self.acceleration, self.jerk,
        )  # fmt: skip

    def rest_point(self) -> ReferencePoint:
        """Return the last point, at rest: what follows the end of the record."""
        last: ReferencePoint = jax.tree.map(lambda x: np.asarray(np.asarray(x)[-1]), self.points)
        zero = np.zeros(self.n_axes)
        return ReferencePoint(
            last.parameter, np.zeros(()), np.zeros(()), last.position, zero, zero, zero
        )


_BLOCK = 1024
"""Rows evaluated at once: motions of any length are one compiled program."""


def _in_blocks(contour: Contour, profile: list[NDArray[Any]]) -> list[Record]:
    """Return position, velocity, acceleration and jerk, each of shape (n_samples, n_axes)."""
    n = len(profile[0])
    # the last block is filled up with rows from the start
    filled = [np.resize(p, (max(1, -(-n // _BLOCK)), _BLOCK)) for p in profile]
    blocks = [_along(contour, *rows) for rows in zip(*filled, strict=True)]
    return [np.concatenate([np.asarray(b) for b in part])[:n] for part in zip(*blocks, strict=True)]


@jax.jit
def _along(
    contour: Contour, parameter: Array, rate: Array, acceleration: Array, jerk: Array
) -> tuple[Array, Array, Array, Array]:
    def one(p: Scalar, v: Scalar, a: Scalar, j: Scalar) -> tuple[AxisVector, ...]:
        d = contour.derivatives(p, 3)
        return (
            d[0],
            d[1] * v,
            d[2] * v**2 + d[1] * a,
            d[3] * v**3 + 3.0 * d[2] * v * a + d[1] * j,
        )

    return jax.vmap(one)(parameter, rate, acceleration, jerk)  # type: ignore[return-value]
