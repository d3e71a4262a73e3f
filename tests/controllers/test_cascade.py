"""P around PI: discretisation against plain NumPy, lags in closed form, placement, messages."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours import Circle, Line
from contourlab.controllers import Cascade
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel
from contourlab.testing.controllers import check_controller
from contourlab.testing.protocol import run
from contourlab.testing.samples import make_samples

T = 1e-3


def model(command="force", limit=1e4, viscous=(4.0, 7.0)):
    return NominalModel(
        mass=[0.8, 1.5], viscous=viscous, coulomb=[0.3, 0.2], gain=[2.0, 1.5],
        command_limit=[limit, limit], command=command,
    )  # fmt: skip


SHARES = {
    "velocity_feed_forward": 0.8, "acceleration_feed_forward": [0.9, 0.7],
    "friction_feed_forward": 0.5, "friction_velocity": 0.02,
}  # fmt: skip


def test_conformance_with_a_velocity_loop():
    law = Cascade(
        model=model(), position_gain=[40.0, 50.0], velocity_proportional=20.0,
        velocity_integral=300.0, **SHARES,
    )  # fmt: skip
    check_controller(law)


def test_conformance_where_the_drive_has_the_velocity_loop():
    check_controller(Cascade(model=model("velocity"), position_gain=[40.0, 50.0], **SHARES))


@pytest.mark.parametrize("limit", [1e4, 2.0])
def test_against_numpy(limit):
    law = Cascade(
        model=model(limit=limit), position_gain=[40.0, 50.0], velocity_proportional=20.0,
        velocity_integral=[300.0, 500.0], **SHARES,
    )  # fmt: skip
    circle = Circle(radius=0.01)
    samples = make_samples(circle, 80, T)
    commands, _ = run(law.bind(circle, T), samples)
    r, m = samples.reference, law.model
    integral, out = np.zeros(2), []
    for k in range(80):
        v = r.velocity[k]
        error = (
            np.array([40.0, 50.0]) * (r.position[k] - samples.position[k])
            + 0.8 * v - samples.velocity[k]
        )  # fmt: skip
        u = 20.0 * error + np.array([300.0, 500.0]) * integral + (
            np.array([0.9, 0.7]) * m.mass * r.acceleration[k] + 0.8 * m.viscous * v
            + 0.5 * m.coulomb * np.tanh(v / 0.02)
        ) / m.gain  # fmt: skip
        clipped = np.clip(u, -limit, limit)
        integral = integral + np.where((u - clipped) * error > 0.0, 0.0, T * error)
        out.append(clipped)
    assert_allclose(commands, out, rtol=0, atol=1e-11)


def velocity_machine(law, contour, rate, n):
    """An ideal velocity drive, x' = u, held between samples; returns reference and position."""
    bound = law.bind(contour, T)
    k = np.arange(n)
    from contourlab.recordings.reference import Reference

    reference = Reference.along(
        contour, sample_time=T, parameter=rate * k * T, parameter_rate=0.0 * k + rate,
        parameter_acceleration=0.0 * k, parameter_jerk=0.0 * k,
    )  # fmt: skip
    samples = make_samples(contour, n, T, law.needs, error=(0.0, 0.0), reference=reference)
    samples = jax.tree.map(jnp.asarray, samples)

    def step(carry, sample):
        x, state = carry
        sample = type(sample)(
            time=sample.time, reference=sample.reference, geometry=sample.geometry,
            preview=sample.preview, position=x, velocity=0.0 * x,
        )  # fmt: skip
        u, state = bound.step(state, sample)
        return (x + T * u, state), x

    first = jax.tree.map(lambda x: x[0], samples)
    _, xs = jax.lax.scan(step, (samples.position[0], bound.init(first)), samples)
    return np.asarray(reference.position), np.asarray(xs)


def ideal_drive():
    return NominalModel(
        mass=[1e-6, 1e-6], viscous=[1.0, 1.0], coulomb=[0.0, 0.0], gain=[1.0, 1.0],
        command_limit=[np.inf, np.inf], command="velocity",
    )  # fmt: skip


def test_the_lag_on_a_ramp_is_velocity_over_gain():
    law = Cascade(model=ideal_drive(), position_gain=[20.0, 50.0])
    line = Line(start=(0.0, 0.0), end=(0.3, 0.4))
    reference, xs = velocity_machine(law, line, 0.1, 2000)
    assert_allclose((reference - xs)[-1], [0.06 / 20.0, 0.08 / 50.0], rtol=1e-9)


def test_half_the_velocity_fed_forward_halves_the_lag():
    law = Cascade(model=ideal_drive(), position_gain=20.0, velocity_feed_forward=0.5)
    line = Line(start=(0.0, 0.0), end=(0.3, 0.4))
    reference, xs = velocity_machine(law, line, 0.1, 2000)
    assert_allclose((reference - xs)[-1], np.array([0.03, 0.04]) / 20.0, rtol=1e-9)


def test_the_radius_of_a_circle_shrinks_as_the_loop_filters_it():
    radius, kv, omega = 0.02, 30.0, 5.0
    law = Cascade(model=ideal_drive(), position_gain=kv)
    _, xs = velocity_machine(law, Circle(radius=radius), omega, 1500)
    found = np.linalg.norm(xs[-200:], axis=1)
    z = np.exp(1j * omega * T)
    assert_allclose(found, radius * abs(kv * T / (z - 1.0 + kv * T)), rtol=1e-9)
    # the rule of the docstring, v² / (2 kv² R), to leading order in ω / kv and ω T
    assert_allclose(radius - found, (omega * radius) ** 2 / (2.0 * kv**2 * radius), rtol=0.06)


def test_bandwidth_places_the_poles_of_the_velocity_loop():
    law = Cascade.by_bandwidth(model(), [40.0, 60.0], 30.0, damping=0.9)
    m = law.model
    for i, hz in enumerate([40.0, 60.0]):
        w = 2.0 * np.pi * hz
        loop = [
            m.mass[i], m.viscous[i] + m.gain[i] * law.velocity_proportional[i],
            m.gain[i] * law.velocity_integral[i],
        ]  # fmt: skip
        assert_allclose(loop, m.mass[i] * np.array([1.0, 1.8 * w, w**2]), rtol=1e-12)


@pytest.mark.parametrize("gain", [1.0, 100.0, 1e6])
def test_every_position_gain_is_stable_with_damping_one(gain):
    law = Cascade.by_bandwidth(model(), 40.0, gain)
    m, kp, ki = law.model, law.velocity_proportional[0], law.velocity_integral[0]
    k = m.gain[0]
    whole = [m.mass[0], m.viscous[0] + k * kp, k * (ki + kp * gain), k * ki * gain]
    assert np.max(np.roots(whole).real) < 0.0


def test_messages():
    with pytest.raises(ConfigurationError, match=r"velocity_proportional must be given.*a force"):
        Cascade(model=model(), position_gain=30.0)
    with pytest.raises(ConfigurationError, match=r"velocity_integral must not be given, got 3"):
        Cascade(model=model("velocity"), position_gain=30.0, velocity_integral=3.0)
    with pytest.raises(ConfigurationError, match=r"position_gain must be >= 0 1/s, got -1"):
        Cascade(model=model("velocity"), position_gain=-1.0)
    with pytest.raises(ConfigurationError, match=r"viscous must be > 0"):
        Cascade(model=model("velocity", viscous=(0.0, 1.0)), position_gain=30.0)
    with pytest.raises(RefusedError, match=r"takes a position"):
        Cascade(model=model("position"), position_gain=30.0)
    with pytest.raises(ConfigurationError, match=r"velocity_bandwidth_hz must be >= 0.\d+ Hz"):
        Cascade.by_bandwidth(model(), 0.01, 30.0)


def test_the_rule_says_what_it_cannot_take():
    with pytest.raises(RefusedError, match=r"take a force or a voltage.*position_gain=\.\.\."):
        Cascade.by_bandwidth(model("velocity"), 0.01, 30.0)
    with pytest.raises(RefusedError, match=r"takes a position"):
        Cascade.by_bandwidth(model("position"), 40.0, 30.0)
    with pytest.raises(ConfigurationError, match=r"damping must be > 0, got 0"):
        Cascade.by_bandwidth(model(), 40.0, 30.0, damping=0.0)
    with pytest.raises(ConfigurationError, match=r"position_gain must be >= 0, got -1"):
        Cascade.by_bandwidth(model(), 40.0, -1.0)


@pytest.mark.parametrize("name", ["velocity_bandwidth_hz", "position_gain", "damping"])
def test_the_rule_wants_one_value_per_axis(name):
    values = {"velocity_bandwidth_hz": 40.0, "position_gain": 30.0}
    with pytest.raises(ConfigurationError, match=rf"{name} must be one number .* the 2 axes"):
        Cascade.by_bandwidth(model(), **(values | {name: [10.0, 20.0, 30.0]}))
    with pytest.raises(ConfigurationError, match=rf"{name} must be a number, got 'a'"):
        Cascade.by_bandwidth(model(), **(values | {name: "a"}))
