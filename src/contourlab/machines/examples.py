"""Plausible machines to try things on. No number here was measured on a real product."""

from __future__ import annotations

import numpy as np

from contourlab.errors import ConfigurationError
from contourlab.feedrate.limits import AxisLimits
from contourlab.machines.ball_screw import BallScrewAxes
from contourlab.machines.cogging import Cogging
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import Encoder
from contourlab.machines.friction import Friction
from contourlab.machines.geometric_errors import GeometricErrors, PositionError, Squareness
from contourlab.machines.machine import Machine
from contourlab.machines.rigid import RigidAxes
from contourlab.machines.transfer_function import TransferFunctionAxes
from contourlab.machines.two_mass import TwoMassAxes

__all__ = ["ball_screw_stage", "iron_core_stage", "linear_motor_stage", "machining_centre"]

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


_LEADS = np.array((0.012, 0.012, 0.010))  # m


def machining_centre(*, computing_delay: float = 0.0) -> Machine:
    """Return a three-axis machining centre on ball screws, measured on its motors; plausible.

    The drives take a torque reference of ±10 V. The screws bend, with the load swinging at 64, 50
    and 67 Hz while the motor stands; nuts have 3 to 5 µm of backlash, screws a pitch error and a
    lead that has grown with their temperature, and the axes are not quite square. The motor
    encoders see none of that. Z is counterbalanced.

    Parameters
    ----------
    computing_delay
        From measuring to acting [s].
    """
    return Machine(
        names=("X", "Y", "Z"),
        dynamics=BallScrewAxes(
            lead=_LEADS,
            motor_inertia=(12e-4, 12e-4, 14e-4),  # kg m², plausible for 8 N m; Z with a brake
            screw_inertia=(8.3e-4, 7.5e-4, 5.5e-4),  # kg m², 32 mm × 0.9, 0.8, 0.55 m and coupling
            table_mass=(250.0, 420.0, 280.0),  # kg; Y carries X
            motor_viscous=3e-3,  # N m s/rad, plausible example
            table_viscous=(1500.0, 2000.0, 1500.0),  # N s/m, plausible example
            torque_constant=1.2,  # N m/A, plausible example
            amplifier_gain=2.0,  # A/V: 10 V for a peak of 24 N m
            stiffness=(4.0e7, 4.2e7, 5.0e7),  # N/m, plausible for screw, nut and bearings
            damping_ratio=0.03,  # plausible example
            motor_friction=Friction(
                coulomb=(0.6, 0.6, 0.5),  # N m, of a preloaded nut and bearings
                stribeck_velocity=5e-3,  # m/s, plausible example
                smoothing_velocity=1e-4,  # m/s, assumed
            ),
            table_friction=Friction(
                coulomb=(150.0, 220.0, 160.0),  # N, plausible for roller guides and wipers
                breakaway=(220.0, 320.0, 230.0),  # N, plausible example
                stribeck_velocity=5e-3,  # m/s, plausible example
                smoothing_velocity=1e-4,  # m/s, assumed
            ),
            backlash=(4e-6, 5e-6, 3e-6),  # m, plausible for a worn preload
        ),
        drive=Drive(command="voltage", command_limit=10.0, computing_delay=computing_delay),
        sensor=Encoder(resolution=_LEADS / 2**17, side="motor"),  # m: 17 bits per revolution
        errors=GeometricErrors(
            screw=PositionError(
                scale=(30e-6, 25e-6, 20e-6),  # m/m: two to three kelvin of a steel screw
                amplitude=(1.5e-6, 1.5e-6, 1.0e-6),  # m, plausible for accuracy class C3
                period=_LEADS,
                phase=(0.3, 1.7, 2.9),  # rad, arbitrary
            ),
            squareness=(
                Squareness(axes=("X", "Y"), angle=25e-6),  # rad, plausible example
                Squareness(axes=("X", "Z"), angle=-20e-6),  # rad, plausible example
                Squareness(axes=("Y", "Z"), angle=15e-6),  # rad, plausible example
            ),
        ),
        travel=((0.0, 0.5), (0.0, 0.4), (-0.3, 0.0)),  # m
        limits=AxisLimits(
            velocity=np.array((0.5, 0.5, 0.4)),  # m/s: 2500 and 2400 of 3000 rev/min
            acceleration=np.array((4.0, 3.0, 3.5)),  # m/s²: a quarter of what the peak torque gives
            jerk=np.full(3, 50.0),  # m/s³, plausible: a full ramp in 80 ms, past the first modes
        ),
        substeps=10,
        title="Machining centre on ball screws, measured on the motors",
        assumed=(
            EXAMPLE,
            "Current loops are ideal and Z is counterbalanced; thermal growth stands still.",
        ),
    )


def iron_core_stage(*, computing_delay: float = 0.0) -> Machine:
    """Return an XY stage on iron-core linear motors with cogging and a soft fixture; plausible.

    The scales sit on the slides. What is worked on swings on them at 95 and 120 Hz, which the
    scales feel only through the reaction. Commands are forces; current loops are ideal.

    Parameters
    ----------
    computing_delay
        From measuring to acting [s].
    """
    return Machine(
        names=("X", "Y"),
        dynamics=TwoMassAxes.by_frequency(
            mass=np.array((34.0, 22.0)),  # kg; X carries Y
            mass_ratio=np.array((0.3, 0.4)),  # fixture over slide, plausible example
            anti_resonance_hz=np.array((95.0, 120.0)),  # Hz, plausible example
            damping_ratio=0.02,  # plausible example
            motor_viscous=np.array((60.0, 45.0)),  # N s/m, plausible example
            motor_friction=Friction(
                coulomb=(14.0, 10.0),  # N, plausible for recirculating guides
                breakaway=(19.0, 14.0),  # N, plausible example
                stribeck_velocity=5e-3,  # m/s, plausible example
                smoothing_velocity=1e-4,  # m/s, assumed
            ),
            cogging=(
                Cogging(amplitude=(9.0, 7.0), period=0.024, phase=(0.4, 1.1)),  # N, one per pole
                Cogging(amplitude=(4.0, 3.0), period=0.012, phase=(2.0, 0.2)),  # N, its harmonic
            ),
        ),
        drive=Drive(
            command="force", command_limit=(900.0, 600.0), computing_delay=computing_delay
        ),  # N, from the current limit of the drives
        sensor=Encoder(resolution=0.1e-6, side="motor"),  # m
        errors=GeometricErrors(
            screw=PositionError(scale=(8e-6, 5e-6)),  # m/m, of the scales, plausible example
            squareness=(Squareness(axes=("X", "Y"), angle=-12e-6),),  # rad, plausible example
        ),
        travel=((-0.25, 0.25), (-0.2, 0.2)),  # m
        limits=AxisLimits(
            velocity=np.full(2, 1.5),  # m/s, plausible example
            acceleration=np.array((12.0, 12.0)),  # m/s²: under half the force
            jerk=np.full(2, 1200.0),  # m/s³: full acceleration in 10 ms
        ),
        substeps=10,
        title="XY stage on iron-core linear motors",
        assumed=(EXAMPLE, "Current loops are ideal; cable forces are left out."),
    )
