"""Geometric errors: where the tool really is when the encoders say that it is right.

Along each axis, in the order in which the motion passes them:

1. motor to table, e_screw: the table is at y = q + e_screw(q) when the motor and the spring put it
   at q. Lead error, thermal growth of the screw, pitch error once per revolution. A motor-side
   encoder does not see it; a scale on the table does. (On a linear motor that is measured on its
   slide, these are the errors of the scale there.)
2. scale to table, e_scale: a scale shows y - e_scale(y) when the table is at y. Thermal growth of
   the scale, its interpolation error. Only a tool-side encoder has it.
3. between the axes: squareness. No encoder sees it.

So a positive error is one that carries the tool further in the positive direction than is shown.
Each error is e(y) = s y + a sin(2π y / p + φ): zero at position zero if φ is.

Squareness α of a pair (first, second): the angle between their positive directions is π/2 + α, with
the first axis as the datum, so that a move of +y along the second carries the tool by -α y along
the first. Small angles: terms in α² are left out, 5e-9 of the travel at 0.1 mrad.

The errors are truth: laws are told nothing of them, and a machine with errors has the same tool map
as one without. They are kinematic: the slope of e_screw, below 1e-2, is left out of the inertia.
"""

from __future__ import annotations

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import Configuration, part, real, static
from contourlab.errors import ConfigurationError, choices
from contourlab.machines.base import PerAxis, per_axis
from contourlab.typing import AxisVector, Matrix, Scalar

__all__ = ["BoundErrors", "GeometricErrors", "PositionError", "Squareness"]

LARGEST_SLOPE = 0.1
_NEWTON_STEPS = 4
"""From a slope of 0.1 the error falls as its square: 1e-2, 1e-4, 1e-8, below rounding."""


class PositionError(Configuration):
    """Scale and cyclic error along every axis; a single number holds for every axis."""

    scale: PerAxis = real(unit="m/m", ndim=1, default=0.0)
    """s, relative; 1e-5 is 10 µm per metre [m/m]."""
    amplitude: PerAxis = real(unit="m", minimum=0.0, ndim=1, default=0.0)
    """a, half the cyclic error from peak to valley [m]."""
    period: PerAxis = real(unit="m", above=0.0, ndim=1, default=0.01)
    """p: the lead of a screw, the grating of a scale [m]."""
    phase: PerAxis = real(unit="rad", ndim=1, default=0.0)
    """φ, at position zero [rad]."""

    def check(self) -> None:
        """Check that positions keep their order: no slope near one."""
        slope = np.abs(self.scale) + 2.0 * math.pi * np.asarray(self.amplitude) / self.period
        if np.any(slope > LARGEST_SLOPE):
            raise ConfigurationError(
                f"scale + 2 pi amplitude / period must be <= {LARGEST_SLOPE:g}, an error and not a "
                f"gear, got {np.max(slope):g}"
            )

    def check_axes(self, n_axes: int, name: str) -> None:
        """Check that every field has one value per axis or one for all.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        name
            What the error is called there, for messages.
        """
        for field in dataclasses.fields(self):
            per_axis(f"{name}.{field.name}", getattr(self, field.name), n_axes)

    def bind(self, n_axes: int) -> BoundPositionError:
        """Return the error with one value per axis.

        Parameters
        ----------
        n_axes
            Number of axes.
        """
        values = {f.name: per_axis(f.name, getattr(self, f.name), n_axes)
                  for f in dataclasses.fields(self)}  # fmt: skip
        wave_number = 2.0 * math.pi / values.pop("period")
        return BoundPositionError(**values, wave_number=wave_number)


class Squareness(Configuration):
    """Departure from the right angle of two axes."""

    axes: tuple[str, str] = static()
    """Names of the first axis, the datum, and of the second."""
    angle: Scalar = real(unit="rad", above=-LARGEST_SLOPE, below=LARGEST_SLOPE, ndim=0)
    """α, positive where the angle is more than a right one [rad]."""

    def __check_init__(self) -> None:
        axes = self.axes
        if not isinstance(axes, tuple) or len(axes) != 2 or axes[0] == axes[1]:
            raise ConfigurationError(f"axes must name two different axes, got {axes!r}")


class GeometricErrors(Configuration):
    """The errors of a machine's axes and of the angles between them."""

    screw: PositionError | None = part(default=None)
    """Between motor and table, which only a scale sees; none if not given."""
    scale: PositionError | None = part(default=None)
    """Of linear scales, which nothing sees; none if not given."""
    squareness: tuple[Squareness, ...] = part(default=())
    """One for each pair that is not square."""

    def check_axes(self, names: tuple[str, ...]) -> None:
        """Check that the errors are those of axes of these names.

        Parameters
        ----------
        names
            Of the machine's axes.
        """
        for name in ("screw", "scale"):
            error = getattr(self, name)
            if error is not None:
                error.check_axes(len(names), f"errors.{name}")
        seen: list[tuple[str, ...]] = []
        for pair in self.squareness:
            for axis in pair.axes:
                if axis not in names:
                    raise ConfigurationError(
                        f"squareness: no axis {axis!r}; {choices(axis, names)}"
                    )
            if tuple(sorted(pair.axes)) in seen:
                raise ConfigurationError(f"squareness of {pair.axes} is given twice")
            seen.append(tuple(sorted(pair.axes)))

    def bind(self, names: tuple[str, ...]) -> BoundErrors:
        """Return the errors with one value per axis.

        Parameters
        ----------
        names
            Of the machine's axes.
        """
        n_axes = len(names)
        matrix = None
        if self.squareness:
            rows = [names.index(pair.axes[0]) for pair in self.squareness]
            columns = [names.index(pair.axes[1]) for pair in self.squareness]
            angles = jnp.stack([jnp.asarray(pair.angle) for pair in self.squareness])
            matrix = jnp.eye(n_axes).at[np.asarray(rows), np.asarray(columns)].add(-angles)
        screw, scale = (None if e is None else e.bind(n_axes) for e in (self.screw, self.scale))
        return BoundErrors(screw, scale, matrix)


class BoundPositionError(eqx.Module):
    """A position error with one value per axis."""

    scale: AxisVector
    amplitude: AxisVector
    wave_number: AxisVector
    phase: AxisVector

    def value(self, position: AxisVector) -> AxisVector:
        """Return e, shape (n_axes,) [m].

        Parameters
        ----------
        position
            Shape (n_axes,) [m].
        """
        return self.scale * position + self.amplitude * jnp.sin(
            self.wave_number * position + self.phase
        )


class BoundErrors(eqx.Module):
    """From positions of the dynamics to those of scales and tool."""

    screw: BoundPositionError | None
    scale: BoundPositionError | None
    matrix: Matrix | None
    """Squareness; None where all is square."""

    def table(self, position: AxisVector) -> AxisVector:
        """Return where the tables are, each along its own guide [m].

        Parameters
        ----------
        position
            Of the load, as the dynamics move it, shape (n_axes,) [m].
        """
        return position if self.screw is None else position + self.screw.value(position)

    def shown(self, position: AxisVector) -> AxisVector:
        """Return what linear scales show [m].

        Parameters
        ----------
        position
            Of the load, as the dynamics move it, shape (n_axes,) [m].
        """
        table = self.table(position)
        return table if self.scale is None else table - self.scale.value(table)

    def tool(self, position: AxisVector) -> AxisVector:
        """Return where the tool is, in square and true axis coordinates [m].

        Parameters
        ----------
        position
            Of the load, as the dynamics move it, shape (n_axes,) [m].
        """
        table = self.table(position)
        return table if self.matrix is None else jnp.sum(self.matrix * table, -1)

    def behind(self, shown: AxisVector) -> AxisVector:
        """Return the load positions at which linear scales show a position: the inverse of shown.

        Parameters
        ----------
        shown
            Shape (n_axes,) [m].
        """
        if self.screw is None and self.scale is None:
            return shown
        position = shown
        for _ in range(_NEWTON_STEPS):
            value, slope = jax.jvp(self.shown, (position,), (jnp.ones_like(position),))
            position = position - (value - shown) / slope
        return position
