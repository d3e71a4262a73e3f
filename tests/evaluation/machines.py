"""Machines with one cause of contour error each, or all of them, and a motion that shows them."""

from functools import cache

import numpy as np

import contourlab as cl
from contourlab.machines import (
    Drive,
    Encoder,
    Friction,
    GeometricErrors,
    Machine,
    PositionError,
    SineDisturbance,
    Squareness,
    TwoMassAxes,
)

SAMPLE_TIME = 2e-3
RADIUS = 0.03
FAST, SLOW = 0.08, 0.04  # m/s
LAG = (1 / 30.0, 1 / 36.0)
BACKLASH = 12e-6
ANGLE = 80e-6
SCALE = 60e-6
AMPLITUDE, PERIOD = 3e-6, 0.010
FREQUENCY, FORCE = 43.0, 4.0
FRICTION = 12.0


@cache
def reference():
    """A circle in both directions at two feeds, from rest to rest."""
    rates = []
    for sign in (1.0, -1.0):
        for feed in (FAST, SLOW):
            rate = feed / RADIUS
            ramp = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 100))
            turn = round((2.15 * np.pi / rate) / SAMPLE_TIME)
            rest = np.zeros(75)
            rates.append(
                sign * rate * np.concatenate([rest, ramp, np.ones(turn), ramp[::-1], rest])
            )
    rate = np.concatenate(rates)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) * SAMPLE_TIME
    acceleration = np.gradient(rate, SAMPLE_TIME)
    jerk = np.gradient(acceleration, SAMPLE_TIME)
    return cl.recordings.Reference.along(
        cl.contours.Circle(radius=RADIUS, center=(0.0, 0.0)), sample_time=SAMPLE_TIME,
        parameter=angle, parameter_rate=rate, parameter_acceleration=acceleration,
        parameter_jerk=jerk,
    )  # fmt: skip


def machine(*, friction=0.0, backlash=0.0, angle=0.0, scale=0.0, amplitude=0.0, side="motor"):
    return Machine(
        names=("X", "Y"),
        dynamics=TwoMassAxes(
            motor_mass=30.0, load_mass=10.0, stiffness=4e7, damping=4e3, motor_viscous=100.0,
            load_viscous=20.0,
            motor_friction=Friction(coulomb=(friction, 0.0), smoothing_velocity=2e-4),
            load_friction=Friction(coulomb=(0.0, 6.0), smoothing_velocity=2e-4),
            backlash=(0.0, backlash),
        ),
        drive=Drive(command="force", command_limit=2000.0),
        sensor=Encoder(resolution=1e-8, side=side),
        errors=GeometricErrors(
            screw=PositionError(scale=(scale, 0.0), amplitude=(amplitude, 0.0), period=PERIOD),
            squareness=(Squareness(axes=("X", "Y"), angle=angle),),
        ),
        substeps=10,
    )  # fmt: skip


def controller(plant, gains=(30.0, 30.0)):
    return cl.controllers.Cascade(
        model=plant.nominal, position_gain=gains, velocity_proportional=8000.0,
        velocity_integral=4e5,
    )  # fmt: skip


def run(*, gains=(30.0, 30.0), vibration=0.0, **causes):
    plant = machine(**causes)
    disturbances = SineDisturbance(axis=1, amplitude=vibration, frequency_hz=FREQUENCY)
    return cl.simulate(plant, controller(plant, gains), reference(), disturbances=disturbances)
