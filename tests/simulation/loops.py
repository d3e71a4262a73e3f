"""Small machines, laws and references for the tests of the loop."""

import jax.numpy as jnp
import numpy as np

from contourlab.configuration import part, real, static
from contourlab.contours import Line
from contourlab.controllers import BoundController, Controller
from contourlab.controllers.base import Needs
from contourlab.machines import Drive, Encoder, Machine, RigidAxes
from contourlab.recordings import Reference


def line_reference(velocity=(0.02, 0.01), n=400, sample_time=1e-3):
    """Constant velocity from the origin along a line."""
    velocity = np.asarray(velocity, float)
    speed = np.linalg.norm(velocity)
    duration = (n - 1) * sample_time
    contour = Line(start=np.zeros(len(velocity)), end=velocity * (duration + 1.0))
    time = np.arange(n) * sample_time
    zero = np.zeros(n)
    return Reference.along(
        contour, sample_time=sample_time, parameter=speed * time, parameter_rate=speed + zero,
        parameter_acceleration=zero, parameter_jerk=zero,
    )  # fmt: skip


def velocity_stage(lags=(0.01, 0.01), **changes):
    """Drives that follow a velocity with a time constant: τ q'' + q' = u."""
    fields = {
        "names": ("X", "Y", "Z")[: len(lags)],
        "dynamics": RigidAxes(mass=list(lags), viscous=[1.0] * len(lags), gain=[1.0] * len(lags)),
        "drive": Drive(command="velocity"),
        "sensor": Encoder(velocity="ideal"),
    }
    return Machine(**{**fields, **changes})


class Proportional(Controller):
    """u = k e on every axis, with a status, telemetry and an end."""

    k: object = real(unit="1/s")
    axes: int = static(default=2)
    preview: int = static(default=0)
    stop_at: int = static(default=-1)
    tool_map: bool = static(default=False)

    @property
    def needs(self):
        return Needs(
            command="velocity", preview=self.preview, derivatives=1, tool_map=self.tool_map
        )

    @property
    def n_axes(self):
        return self.axes

    def bind(self, contour, sample_time):
        return BoundProportional(law=self)


class BoundProportional(BoundController):
    law: Proportional = part()
    statuses = ("normal", "odd")

    def init(self, sample):
        return {"step": jnp.zeros((), jnp.int32), "ahead": self._ahead(sample)}

    def _ahead(self, sample):
        if self.law.preview == 0:
            return jnp.zeros(sample.position.shape)
        return sample.preview.position[-1]

    def step(self, state, sample):
        command = self.law.k * (sample.reference.position - sample.position)
        return command, {"step": state["step"] + 1, "ahead": self._ahead(sample)}

    def telemetry(self, state):
        return {"ahead": state["ahead"], "count": state["step"].astype(float)}

    def status(self, state):
        return (state["step"] == 3).astype(jnp.int32)

    def finished(self, state):
        return state["step"] == self.law.stop_at


class TwoVelocities(Controller):
    """Commands the velocities of two axes."""

    @property
    def needs(self):
        return Needs(command="velocity")

    @property
    def n_axes(self):
        return 2


class Pulse(TwoVelocities):
    """Commands 1 on axis 0 at one step, and 0 otherwise."""

    at: int = static(default=3)

    def bind(self, contour, sample_time):
        return BoundPulse(at=self.at)


class BoundPulse(BoundController):
    at: int = static()

    def init(self, sample):
        return jnp.zeros((), jnp.int32)

    def step(self, state, sample):
        return jnp.array([1.0, 0.0]) * (state == self.at), state + 1
