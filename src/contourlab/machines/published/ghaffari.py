"""The servo axes of Ghaffari and Ulsoy's simulations: two published, and three of the same kind.

    P' = V,   V' = -V / τ + (k / τ) (T + D)                       (1), (2)

with k1 = 10.3, k2 = 10, τ1 = 40 ms, τ2 = 45 ms and |D| = 0.15 on each axis (section IV). The effort
is written in the unit of the command, so that a disturbance is the paper's D: M = τ / k, B = 1 / k,
K = 1.

What the paper leaves open, and what stands here instead:

- Units of k and D. The contour is in millimetres and h_r = 50 bends it only if printed in 1/m;
  taken: k in mm/s per unit of command, the command and D in that unit, here called volts. Read in
  metres D alone would make errors of millimetres.
- Course and signs of D. Taken, where the published experiments are run: -0.15 V on both axes,
  constant (:data:`DISTURBANCE`). Of the readings tried it is the one that comes near all of the
  published figures of the variable-gain scheme; signs are not printed.
- Start. Taken: at rest at the first reference point, the reference moving at once.
- Sensors, limits and delays: none in the paper. Taken: true position and velocity, no limit, no
  delay.
- A third axis. The paper claims any number of axes and shows two. Assumed where three are asked
  for: k3 = 9.7 and τ3 = 50 ms, on from the other two by about their difference.

References
----------
.. [GhaffariUlsoy] equations (1) and (2), section IV.
"""

from __future__ import annotations

import numpy as np

from contourlab.errors import ConfigurationError
from contourlab.machines.disturbance import StepDisturbance
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import Encoder
from contourlab.machines.machine import Machine
from contourlab.machines.rigid import RigidAxes

__all__ = ["ghaffari_disturbance", "ghaffari_three_axes", "ghaffari_two_axes"]

GAIN = (10.3e-3, 10.0e-3, 9.7e-3)
"""k [m/s per V]; the third assumed."""
TIME_CONSTANT = (0.040, 0.045, 0.050)
"""τ [s]; the third assumed."""
DISTURBANCE = -0.15
"""D [V]; the magnitude is printed, sign and course are assumed."""
_OPEN = (
    "The paper prints no units of k and D; assumed: mm/s per volt, and volts.",
    "It names no sensors, limits or delays; assumed: true position and velocity, none of the rest.",
)


def ghaffari_two_axes() -> Machine:
    """Return the two axes of the simulations; the command is a voltage."""
    return _axes(2)


def ghaffari_three_axes() -> Machine:
    """Return the two axes and a third of the same kind, which the paper does not have."""
    return _axes(3)


def ghaffari_disturbance(n_axes: int = 2) -> tuple[StepDisturbance, ...]:
    """Return the disturbance of the published experiments as assumed: -0.15 V on every axis.

    Parameters
    ----------
    n_axes
        Number of axes, 1 to 3.

    Raises
    ------
    ConfigurationError
        Another number of axes.
    """
    if n_axes not in (1, 2, 3):
        raise ConfigurationError(f"n_axes must be 1, 2 or 3, got {n_axes!r}")
    return tuple(StepDisturbance(axis=axis, amplitude=DISTURBANCE) for axis in range(n_axes))


def _axes(n_axes: int) -> Machine:
    gain, lag = np.array(GAIN[:n_axes]), np.array(TIME_CONSTANT[:n_axes])
    third = ("The third axis is assumed: 9.7 mm/s per volt and 50 ms.",) if n_axes == 3 else ()
    return Machine(
        names=("X", "Y", "Z")[:n_axes],
        dynamics=RigidAxes(mass=lag / gain, viscous=1.0 / gain),
        drive=Drive(command="voltage"),
        sensor=Encoder(velocity="ideal"),
        assumed=(*_OPEN, *third),
    )
