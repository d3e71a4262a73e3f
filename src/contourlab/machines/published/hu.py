"""The industrial biaxial gantry of Hu, Yao and Wang: linear motors that take a voltage.

From the paper, section IV: encoders of 0.5 µm after quadrature, velocity by difference, a control
cycle of 0.2 ms; identified parameters in volts, without payload and, as an equivalent of the 5 kg
payload, the two masses; the smooth sign that they were identified with.

What the paper leaves open, and what stands here instead:

- What the dry friction really does near rest. Assumed: the smooth sign itself; with
  ``presliding=True`` a contact that slides after some 10 µm, with 10 % more friction below 20 mm/s.
- Cogging, which it does not mention (an earlier work of the same authors on this gantry compensates
  it). Assumed: none; with ``cogging=True`` 0.1 V at a pitch of 30 mm on both axes: round numbers
  near those that an earlier simulation was fitted with to the printed rms of Set 1, so that the
  level in Set 1 is no prediction. Another pitch moves the rms between about 1.4 and 2.8 µm.
- Computing delay. Assumed: none; ``computing_delay`` adds one.
- Limits of command, travel and axes. Assumed: ±10 V, travel that holds the figures, and limits that
  they do not reach.

References
----------
.. [HuYaoWang] section IV.A and B.
"""

from __future__ import annotations

import numpy as np

from contourlab.feedrate.limits import AxisLimits
from contourlab.machines.arctan_friction import ArctanFriction
from contourlab.machines.base import Dynamics, NominalModel
from contourlab.machines.cogging import Cogging
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import Encoder
from contourlab.machines.machine import Machine
from contourlab.machines.presliding import PreslidingAxes
from contourlab.machines.rigid import RigidAxes

__all__ = ["hu_gantry"]

MASS = (0.12, 0.55)
"""V/(m/s²), without payload."""
LOADED_MASS = (0.19, 0.62)
VISCOUS = (0.35, 0.5)
"""V/(m/s)."""
COULOMB = (0.1, 0.13)
"""V."""
SIGN_WIDTH = 1.0 / 9000.0
"""v_0 of the smooth sign [m/s]."""
COGGING = (0.1, 0.03)
"""Amplitude [V] and pitch [m], assumed."""
PRESLIDING = (10e-6, 1.1, 0.02)
"""Distance [m], breakaway over Coulomb, Stribeck velocity [m/s]; assumed."""


def hu_gantry(
    *,
    payload: bool = False,
    cogging: bool = False,
    presliding: bool = False,
    computing_delay: float = 0.0,
    encoder: float = 0.5e-6,
) -> Machine:
    """Return the gantry; laws are told the identified parameters without payload.

    Parameters
    ----------
    payload
        Whether it carries the 5 kg.
    cogging
        Whether its motors cog; assumed.
    presliding
        Whether dry friction has presliding and more friction at low speed; assumed.
    computing_delay
        From measuring to acting [s]; assumed.
    encoder
        Distance between encoder counts [m]; 0 for exact ones.
    """
    mass = np.array(LOADED_MASS if payload else MASS)
    cogs = (Cogging(amplitude=COGGING[0], period=COGGING[1]),) if cogging else ()
    dynamics: Dynamics
    if presliding:
        dynamics = PreslidingAxes(
            mass=mass, viscous=VISCOUS, coulomb=COULOMB,
            breakaway=PRESLIDING[1] * np.array(COULOMB), stribeck_velocity=PRESLIDING[2],
            presliding_distance=PRESLIDING[0], cogging=cogs,
        )  # fmt: skip
    else:
        friction = ArctanFriction(coulomb=COULOMB, smoothing_velocity=SIGN_WIDTH)
        dynamics = RigidAxes(mass=mass, viscous=VISCOUS, friction=friction, cogging=cogs)
    assumed = [
        "The paper gives no limit of command, travel and axes; assumed: +-10 V, +-0.25 m and -0.05 "
        "to 0.35 m, 1 m/s, 5 m/s^2 and 100 m/s^3.",
    ]
    if presliding:
        assumed.append(
            f"Assumed: dry friction that slides after some {1e6 * PRESLIDING[0]:g} um, with "
            f"{100 * (PRESLIDING[1] - 1):.0f} % more below {1e3 * PRESLIDING[2]:g} mm/s."
        )
    else:
        assumed.append("The paper's smooth sign is taken for what dry friction does near rest.")
    if cogging:
        assumed.append(
            f"Assumed: cogging of {COGGING[0]:g} V at a pitch of {1e3 * COGGING[1]:g} mm on both "
            "axes. Amplitude and pitch are round numbers near those that an earlier simulation was "
            "fitted with to the rms of Set 1, so that the level in Set 1 is no prediction; another "
            "pitch moves the rms between about 1.4 and 2.8 um."
        )
    if computing_delay:
        assumed.append(f"Assumed: a computing delay of {1e3 * computing_delay:g} ms.")
    return Machine(
        names=("X", "Y"),
        dynamics=dynamics,
        drive=Drive(command="voltage", command_limit=10.0, computing_delay=computing_delay),
        sensor=Encoder(resolution=encoder),  # 0.5 µm, section IV.A
        travel=((-0.25, 0.25), (-0.05, 0.35)),  # m, assumed
        limits=AxisLimits(
            velocity=np.full(2, 1.0), acceleration=np.full(2, 5.0), jerk=np.full(2, 100.0)
        ),  # assumed
        substeps=10,
        nominal_model=NominalModel(
            mass=np.array(MASS), viscous=np.array(VISCOUS), coulomb=np.array(COULOMB),
            gain=np.ones(2), command_limit=np.full(2, 10.0), command="voltage",
        ),  # section IV.A
        assumed=tuple(assumed),
    )  # fmt: skip
