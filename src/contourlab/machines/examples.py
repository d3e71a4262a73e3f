"""Plausible machines to try things on. No number here was measured on a real product."""

from __future__ import annotations

import numpy as np

from contourlab.errors import ConfigurationError
from contourlab.feedrate.limits import AxisLimits
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import Encoder
from contourlab.machines.friction import Friction
from contourlab.machines.machine import Machine
from contourlab.machines.rigid import RigidAxes
from contourlab.machines.transfer_function import TransferFunctionAxes

__all__ = ["ball_screw_stage", "linear_motor_stage"]

EXAMPLE = "An example, not a measured product: every number is plausible, none was measured."


def linear_motor_stage(*, encoder: float = 0.1e-6, computing_delay: float = 0.0) -> Machine:
    """Return a stacked XY stage on linear motors that takes forces; plausible, not a product.

    X carries Y, hence the masses. Current loops are taken as ideal, with a limit: the time constant
    of a good one, 0.1 to 0.3 ms, is below the usual sample time. Cogging and cable forces are left
    out; add a disturbance for them.

    Parameters
    ----------
    encoder
        Distance between encoder counts [m]: 0.1 µm, or 1 µm for a plain stage.
    computing_delay
        From measuring to acting [s].
    """
    return Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(
            mass=(5.0, 3.0),  # kg, plausible example
            viscous=(25.0, 18.0),  # N s/m, plausible example
            gain=1.0,  # the command is the force in N
            friction=Friction(
                coulomb=(6.0, 4.0),  # N, plausible for recirculating linear guides
                breakaway=(8.0, 5.5),  # N, plausible example
                stribeck_velocity=5e-3,  # m/s, plausible example
                smoothing_velocity=1e-4,  # m/s, assumed: small beside the Stribeck velocity
            ),
        ),
        drive=Drive(
            command="force",
            command_limit=(150.0, 90.0),  # N, from the current limit of the drives
            computing_delay=computing_delay,
        ),
        sensor=Encoder(resolution=encoder),
        travel=((-0.2, 0.2), (-0.2, 0.2)),  # m
        limits=AxisLimits(
            velocity=np.full(2, 1.0),  # m/s, plausible example
            acceleration=np.array((15.0, 15.0)),  # m/s²: half the force
            jerk=np.full(2, 1500.0),  # m/s³, plausible example: full acceleration in 10 ms
        ),
        substeps=10,
        assumed=(EXAMPLE, "Current loops are ideal; cogging and cable forces are left out."),
    )


_BALL_SCREW_LAGS = (0.010, 0.012, 0.008)
_BALL_SCREW_TRAVEL = ((0.0, 0.5), (0.0, 0.4), (-0.3, 0.0))


def ball_screw_stage(*, n_axes: int = 3, computing_delay: float = 0.0) -> Machine:
    """Return a small machining centre whose drives close the velocity loop; plausible example.

    Each drive takes a velocity and follows it with one time constant, so that the axis is
    1 / (s (τ s + 1)) from velocity command to position. The time constants differ, as they do on
    machines, and an axis therefore lags its neighbour in a curve. Friction is inside the velocity
    loops and taken as removed by them; lost motion is not modelled.

    Parameters
    ----------
    n_axes
        1 to 3 axes: X, Y, Z.
    computing_delay
        From measuring to acting [s].

    Raises
    ------
    ConfigurationError
        Another number of axes.
    """
    if type(n_axes) is not int or n_axes not in (1, 2, 3):
        raise ConfigurationError(f"n_axes must be 1, 2 or 3, got {n_axes!r}")
    return Machine(
        names=("X", "Y", "Z")[:n_axes],
        dynamics=TransferFunctionAxes(
            numerators=((1.0,),) * n_axes,  # m/s per m/s
            denominators=tuple((lag, 1.0, 0.0) for lag in _BALL_SCREW_LAGS[:n_axes]),  # τ [s]
        ),
        drive=Drive(
            command="velocity",
            command_limit=np.array((0.6, 0.6, 0.5))[:n_axes],  # m/s: 36, 36, 30 m/min
            computing_delay=computing_delay,
        ),
        sensor=Encoder(resolution=1e-6),  # m
        travel=_BALL_SCREW_TRAVEL[:n_axes],  # m: 500 × 400 × 300 mm
        limits=AxisLimits(
            velocity=np.array((0.5, 0.5, 0.4))[:n_axes],  # m/s: 30, 30, 24 m/min
            acceleration=np.array((5.0, 5.0, 4.0))[:n_axes],  # m/s²
            jerk=np.full(n_axes, 100.0),  # m/s³
        ),
        assumed=(
            EXAMPLE,
            "The velocity loops remove friction; lost motion is left out.",
        ),
    )
