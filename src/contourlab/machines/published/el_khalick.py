"""The feed drive of El Khalick and Uchiyama: DC motors with ball screws, commanded by a voltage.

From Table 1: pitch of the screws, masses on both axes, inertia and viscous friction of the motors,
torque per volt. Eliminating the torque from (3) to (5), with r = p / 2π,

    x'' = -a x' + b v,    a = (z + c r²) / (n + m r²),    b = r k / (n + m r²),

which is 6.199 1/s and 0.02228 m/s² per V; the tables add 1e-4 of the motors' inertia, so that the
axes are equal to four digits. Held over T = 5 ms this is the paper's (21), but for two slips:

- (21) is of metres and volts, while the references (22), (23) are in mm. Its second coefficient of
  B is printed 0.28e-6 and should round to 0.27e-6 (:data:`PRINTED` has it as printed). The velocity
  per volt, (b_0 + b_1) / (T (1 - a)) with A = (1 - q⁻¹) (1 - a q⁻¹), is 3.9 % too large: 2.0 % by
  the rounding of the other digits, the rest by this one.
- (21) prints B with a leading q⁻¹ and (6) multiplies it by u(k-1): one sample of delay too many.

What the paper leaves open, and what stands here instead:

- Dry friction, which the paper speaks of. Assumed: Coulomb friction worth 0.1 V (0.14 N m).
- Voltage limit. Assumed: ±10 V.
- Sensors. Assumed: true position, no quantisation; velocity as their difference, which the paper's
  law does not use.
- Travel, and what planning may ask. Assumed: ±0.1 m, the speed that 9 V hold against friction,
  0.15 m/s² and 5 m/s³.
- Third axis, which the paper leaves for later. Assumed: the same drive with 5 kg.

References
----------
.. [ElKhalickUchiyama] equations (3) to (5) and (21), Table 1.
"""

from __future__ import annotations

import numpy as np

from contourlab.errors import ConfigurationError
from contourlab.feedrate.limits import AxisLimits
from contourlab.machines.ball_screw import BallScrewAxes
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import Encoder
from contourlab.machines.friction import Friction
from contourlab.machines.machine import Machine

__all__ = ["el_khalick_feed_drive"]

PITCH = 0.005
"""p [m]."""
TORQUE_PER_VOLT = 1.4
"""k [N m/V]."""
INERTIA, VISCOUS = 0.05, 0.31
"""n [kg m²] and z [N m s/rad]."""
MASSES = (8.0, 2.5, 5.0)
"""m of X and Y; that of Z is assumed [kg]."""
PRINTED = {"denominator": (1.0, -1.97, 0.97), "numerator": (0.28e-6, 0.28e-6)}
"""A and B of (21), as printed but for the leading q⁻¹ of B [m/V]."""


def el_khalick_feed_drive(
    *, n_axes: int = 2, workpiece_mass: float = 0.0, coulomb_voltage: float = 0.1,
    noise: float = 0.0,
) -> Machine:  # fmt: skip
    """Return the feed drive; laws are told of Table 1, without workpiece and friction.

    Parameters
    ----------
    n_axes
        2, or 3 with the assumed third axis.
    workpiece_mass
        On every table beyond Table 1, >= 0 [kg].
    coulomb_voltage
        Dry friction, as the voltage that it takes, >= 0; 0 for none [V].
    noise
        Standard deviation of the measured positions, >= 0 [m].

    Raises
    ------
    ConfigurationError
        Another number of axes, or a value that is negative.
    """
    if n_axes not in (2, 3):
        raise ConfigurationError(f"n_axes must be 2 or 3, got {n_axes!r}")
    for name, value in (("workpiece_mass", workpiece_mass), ("coulomb_voltage", coulomb_voltage)):
        if not (np.isfinite(value) and value >= 0.0):
            raise ConfigurationError(f"{name} must be >= 0 and finite, got {value:g}")
    radius = PITCH / (2.0 * np.pi)
    speed = radius * (9.0 - coulomb_voltage) * TORQUE_PER_VOLT / VISCOUS
    friction = Friction(
        coulomb=TORQUE_PER_VOLT * coulomb_voltage,  # N m, assumed
        smoothing_velocity=1e-7,  # m/s, assumed: nearly true sticking
    )
    extra = "" if n_axes == 2 else " The third axis is assumed: the same drive with 5 kg."
    drive = Drive(command="voltage", command_limit=10.0)  # V, assumed

    def axes(mass: float, dry: Friction | None) -> BallScrewAxes:
        return BallScrewAxes(
            lead=PITCH, motor_inertia=INERTIA, table_mass=np.array(MASSES[:n_axes]) + mass,
            motor_viscous=VISCOUS, torque_constant=TORQUE_PER_VOLT, motor_friction=dry,
        )  # fmt: skip

    return Machine(
        names=("X", "Y", "Z")[:n_axes],
        dynamics=axes(workpiece_mass, friction if coulomb_voltage > 0.0 else None),
        drive=drive,
        sensor=Encoder(noise=noise if noise > 0.0 else None),
        travel=(-0.1, 0.1),  # m, assumed
        limits=AxisLimits(
            velocity=np.full(n_axes, speed),  # m/s, assumed
            acceleration=np.full(n_axes, 0.15),  # m/s², assumed: 10 V give 0.22 from rest
            jerk=np.full(n_axes, 5.0),  # m/s³, assumed
        ),
        substeps=50,
        nominal_model=axes(0.0, None).nominal(n_axes, drive),
        assumed=(
            f"The paper states no dry friction; assumed: {coulomb_voltage:g} V of Coulomb friction "
            f"({TORQUE_PER_VOLT * coulomb_voltage:g} N m), its sign smoothed over 0.1 um/s, of "
            "which laws are not told.",
            "It states no voltage limit; assumed: 10 V.",
            f"It states no sensor; assumed: true position with a noise of {1e6 * noise:g} um.",
            "It states no travel and limits; assumed: +-0.1 m, the speed that 9 V hold, 0.15 m/s^2 "
            f"and 5 m/s^3.{extra}",
        ),
        title="Biaxial feed drive (El Khalick, Uchiyama)",
        source="Table 1 of the paper",
    )
