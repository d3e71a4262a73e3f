"""Two predictive laws, a machine and paths for their tests."""

import numpy as np

import contourlab as cl
from contourlab.contours import Circle, Ellipse, Line
from contourlab.controllers import AxisPredictive, PredictiveContouring
from contourlab.machines import Drive, Machine, RigidAxes
from contourlab.machines.base import NominalModel

T = 5e-3
SMALL = {"prediction_horizon": 9, "control_horizon": 3}
WEIGHTS = {"contour_weight": 10.0, "lag_weight": 1.0}
INPUTS = {"normal_input_weight": 1e-9, "tangential_input_weight": 1e-10}
PLAIN = {"disturbance_integrators": 0, "input_filter_numerator": (1.0,)}
BESIDE = {"form": "independent", "disturbance_plant": False}


def model(n=2, *, stiffness=None, limit=np.inf, coulomb=0.0):
    return NominalModel(
        mass=np.array([45.0, 44.9, 60.0, 50.0])[:n],
        viscous=np.array([279.0, 280.0, 200.0, 250.0])[:n],
        coulomb=np.full(n, coulomb), gain=np.ones(n), command_limit=np.full(n, limit),
        command="force", stiffness=stiffness,
    )  # fmt: skip


def law(n=2, *, told=None, **changes):
    return PredictiveContouring(model=told or model(n), **(SMALL | WEIGHTS | INPUTS | changes))


def by_axis(n=2, *, told=None, **changes):
    fields = SMALL | {"input_weight": np.array([1e-9, 2e-10, 5e-10])[:n]} | changes
    return AxisPredictive(model=told or model(n), **fields)


TILTED = Circle(radius=0.02, center=(0.0, 0.01, 0.0), normal=(0.2, -0.3, 1.0))
PATHS = {1: Line(start=(0.0,), end=(0.03,)), 2: Ellipse(semi_axes=(0.03, 0.01)), 3: TILTED}


def stage(n=2, **drive):
    nominal = model(n)
    return Machine(
        names=("X", "Y", "Z")[:n],
        dynamics=RigidAxes(mass=nominal.mass, viscous=nominal.viscous),
        drive=Drive(command="force", **drive),
    )


def circle_reference(rate=4.0, duration=1.2):
    return cl.feedrate.constant_rate(
        Circle(radius=0.02), rate=rate, duration=duration, sample_time=T
    )


def run(controller, machine=None, **settings):
    settings.setdefault("reference", circle_reference())
    return cl.simulate(machine or stage(), controller, **settings)
