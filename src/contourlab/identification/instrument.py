"""Signals that move with the axis and know nothing of the noise.

The measured motion is regressed on the reference, its first two derivatives and its direction: that
is what the axis does as far as the reference tells it, lag included. The command that the model
needs for this motion takes the place of the recorded one. Neither has to be right, only free of
noise: of that only the few coefficients of the regression know.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.least_squares import FilteredLeastSquares
from contourlab.identification.refinement import Drive

__all__ = ["directions", "driving_command", "following_motion"]

Rows = NDArray[Any]


def following_motion(reference: Rows, measured: Rows, sample_time: float) -> Rows:
    """Return what of the measured motion the reference tells, shape (n_samples,) [m].

    Parameters
    ----------
    reference, measured
        Of one axis, shape (n_samples,) [m].
    sample_time
        [s].
    """
    velocity = np.gradient(reference, sample_time)
    columns = np.stack(
        [
            np.ones_like(reference), reference, velocity, np.gradient(velocity, sample_time),
            np.sign(velocity),
        ],
        axis=1,
    )  # fmt: skip
    size = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(size > 0.0, size, 1.0)
    return np.asarray(columns @ np.linalg.lstsq(columns, measured, rcond=1e-10)[0])


def directions(velocity: Rows, law: FilteredLeastSquares, axis: int) -> tuple[Rows, Rows]:
    """Return s_f and s_b over the interval that begins at each instant.

    Parameters
    ----------
    velocity
        At the instants, shape (n_samples,) [m/s].
    law
        Whose smooth sign it is.
    axis
        Which axis.
    """
    mean = np.append(0.5 * (velocity[1:] + velocity[:-1]), velocity[-1])
    width = np.asarray(law.friction_velocity, float)
    x = np.abs(mean) / float(width if width.ndim == 0 else width[axis])
    size = np.tanh(x) if law.friction_shape == "tanh" else 2.0 / np.pi * np.arctan(x)
    return size * (mean > 0.0), size * (mean < 0.0)


def driving_command(
    theta: Rows, motion: Rows, law: FilteredLeastSquares, axis: int, sample_time: float
) -> Drive:
    """Return the command that a model needs for a motion.

    Parameters
    ----------
    theta
        In the order of ``MODEL_PARAMETERS``.
    motion
        Shape (n_samples,) [m].
    law
        Whose smooth sign it is.
    axis
        Which axis.
    sample_time
        [s].
    """
    velocity = np.gradient(motion, sample_time)
    ahead, back = directions(velocity, law, axis)

    def over_interval(x: Rows) -> Rows:
        return np.append(0.5 * (x[1:] + x[:-1]), x[-1])

    command = (
        theta[0] * over_interval(np.gradient(velocity, sample_time))
        + theta[1] * over_interval(velocity)
        + theta[2] * over_interval(motion)
        + theta[3] * ahead
        - theta[4] * back
    )
    at = np.arange(len(command)) * sample_time
    return Drive(np.interp(at + theta[5] + theta[6], at, command), ahead, back, motion)
