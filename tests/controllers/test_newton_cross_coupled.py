"""Cross-coupling by the unity contour error: the guard, against NumPy, any number of axes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.configuration import replace
from contourlab.contour_errors import NewtonEstimator, TangentEstimator
from contourlab.contours import Circle, Ellipse, Helix, Line
from contourlab.controllers import (
    AxisPid,
    CrossCoupled,
    IntegralSlidingMode,
    NewtonCrossCoupled,
)
from contourlab.controllers.newton_cross_coupled import unity_error
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel
from contourlab.machines.published import ghaffari_three_axes
from contourlab.testing.controllers import check_controller
from contourlab.testing.protocol import run
from contourlab.testing.samples import make_samples, sample_at

T = 1e-3


def model(n=2, limit=1e4):
    return NominalModel(
        mass=0.8 + 0.2 * np.arange(n), viscous=4.0 + np.arange(n), coulomb=np.full(n, 0.3),
        gain=np.full(n, 2.0), command_limit=np.full(n, limit), command="voltage",
    )  # fmt: skip


def pid(n=2, limit=1e4):
    return AxisPid(
        model=model(n, limit), kp=300.0, ki=4000.0, kd=6.0, derivative_cutoff_hz=80.0,
        velocity_feed_forward=0.9, acceleration_feed_forward=0.8, friction_feed_forward=0.6,
        friction_velocity=0.02,
    )  # fmt: skip


def coupled(axis, **changes):
    fields = {
        "guard": 1e-5, "kp": 0.05, "ki": 0.4, "kd": 0.002, "derivative_cutoff_hz": 30.0
    }  # fmt: skip
    return NewtonCrossCoupled(axis=axis, **(fields | changes))


def test_conformance_in_the_plane():
    check_controller(coupled(pid(), estimator=TangentEstimator()))


@pytest.mark.overnight
@pytest.mark.slow
def test_conformance_in_space_with_newton_and_sliding_mode():
    axis = IntegralSlidingMode(
        model=model(3), error_rate=15.0, integral_rate=11.0, boundary_layer=2e-3,
        disturbance_bound=0.02, friction_feed_forward=0.5, friction_velocity=0.02,
    )  # fmt: skip
    check_controller(coupled(axis, kp=[0.05, 0.04, 0.06]))


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-6, 1.0])
def test_the_unity_vector(size):
    direction, guard = np.array([2.0, -1.0, 2.0]) / 3.0, 1e-6
    found = unity_error(jnp.asarray(size * direction), guard)
    assert_allclose(found, size / (size + guard) * direction, rtol=1e-12)
    slope = jax.jacobian(unity_error)(jnp.asarray(size * direction), guard)
    # along the error δ / (|E| + δ)², across it 1 / (|E| + δ)
    along = np.outer(direction, direction)
    exact = guard / (size + guard) ** 2 * along + (np.eye(3) - along) / (size + guard)
    assert_allclose(slope, exact, rtol=1e-9, atol=1e-9 / (size + guard))


def test_one_pid_per_axis_on_the_unity_vector():
    contour = Ellipse(semi_axes=(0.03, 0.01))
    axis, estimator = pid(), TangentEstimator()
    gains = {"kp": np.array([0.05, 0.07]), "ki": np.array([0.4, 0.3]), "kd": np.array([0.002, 0])}
    law = coupled(axis, estimator=estimator, **gains)
    samples = make_samples(contour, 120, T, law.needs)
    commands, _ = run(law.bind(contour, T), samples)
    by_axes, _ = run(axis.bind(contour, T), samples)
    decay = np.exp(-2.0 * np.pi * 30.0 * T)
    integral, derivative, last, out = np.zeros(2), np.zeros(2), None, []
    for k in range(120):
        e = np.asarray(estimator.estimate(sample_at(samples, k)))
        unity = e / (np.linalg.norm(e) + 1e-5)
        last = unity if last is None else last
        derivative = decay * derivative + (1.0 - decay) * (unity - last) / T
        last = unity
        out.append(
            by_axes[k] + gains["kp"] * unity + gains["ki"] * integral + gains["kd"] * derivative
        )
        integral = integral + T * unity
    assert_allclose(commands, out, rtol=0, atol=1e-10 * np.max(np.abs(commands)))


def test_a_large_guard_is_cross_coupling_and_a_small_one_bounds_the_push():
    """δ >> |E|: kp / δ on E. δ << |E|: kp in the direction of E, whatever its size."""
    circle = Circle(radius=0.02)
    samples = make_samples(circle, 60, T, coupled(pid(), estimator=TangentEstimator()).needs)
    plain = CrossCoupled(
        axis=pid(), estimator=TangentEstimator(), kp=500.0, ki=6000.0, kd=8.0,
        derivative_cutoff_hz=30.0, form="vector",
    )  # fmt: skip
    wide = coupled(pid(), estimator=TangentEstimator(), guard=1e3, kp=500e3, ki=6000e3, kd=8e3)
    expected, _ = run(plain.bind(circle, T), samples)
    found, _ = run(wide.bind(circle, T), samples)
    assert_allclose(found, expected, rtol=0, atol=1e-6 * np.max(np.abs(expected)))
    alone, _ = run(pid().bind(circle, T), samples)
    relay = coupled(pid(), estimator=TangentEstimator(), guard=1e-12, ki=0.0, kd=0.0)
    pushed, _ = run(relay.bind(circle, T), samples)
    push = np.linalg.norm(pushed - alone, axis=1)
    assert_allclose(np.median(push), 0.05, rtol=1e-4)
    assert np.max(push) <= 0.05 * (1.0 + 1e-9)


def test_the_normal_form_has_no_part_along_the_path():
    helix = Helix(radius=0.02, pitch=0.03, turns=2.0)
    law = coupled(pid(3), form="normal")
    samples = make_samples(helix, 60, T, law.needs)
    commands, state = run(law.bind(helix, T), samples)
    alone, _ = run(pid(3).bind(helix, T), samples)
    assert abs(float(state.integral @ state.tangent)) < 1e-9 * float(
        jnp.linalg.norm(state.integral)
    )
    slopes = np.asarray(samples.geometry[:, 1])
    tangents = slopes / np.linalg.norm(slopes, axis=1)[:, None]
    push = np.asarray(commands - alone)
    assert_allclose(np.sum(push * tangents, axis=1), 0.0, atol=1e-9 * np.max(np.abs(push)))


def test_in_space_it_removes_contour_error_that_the_axes_leave():
    """Three unequal axes, a helix; the estimate is the exact contour error."""
    machine = ghaffari_three_axes()
    helix = Helix(radius=0.02, pitch=0.01, turns=2.0)
    reference = cl.feedrate.constant_feed(helix, feed=0.03, sample_time=2e-4, duration=2.0)
    axis = AxisPid.by_pole_placement(machine.nominal, 3.0, velocity_feed_forward=0.9)
    law = NewtonCrossCoupled(
        axis=axis, guard=5e-6, kp=1.0, ki=10.0, kd=0.1, derivative_cutoff_hz=16.0
    )
    window = (1.0, 2.0)
    alone = cl.simulate(machine, axis, reference).metrics_between(*window)
    recording = cl.simulate(machine, law, reference)
    together = recording.metrics_between(*window)
    assert together["contour_error_rms"] < 0.1 * alone["contour_error_rms"]
    assert together["contour_error_max"] < 5e-6  # the guard
    assert together["estimate_error_max"] < 1e-12
    assert recording.status == "normal"


def test_messages():
    with pytest.raises(ConfigurationError, match=r"guard must be > 0 m, got 0"):
        coupled(pid(), guard=0.0)
    with pytest.raises(
        RefusedError, match=r"NewtonCrossCoupled needs one axis for each coordinate"
    ):
        coupled(pid(3)).bind(Circle(radius=0.1), T)
    with pytest.raises(ConfigurationError, match=r"Allowed: normal, vector"):
        coupled(pid(), form="scalar")
    rough = coupled(pid(), estimator=NewtonEstimator(form="filtered"))
    with pytest.raises(RefusedError, match=r"is not stable at a sample time of 0.01 s"):
        rough.bind(Line(start=(0.0, 0.0), end=(1.0, 0.0)), 0.01)
    with pytest.raises(ConfigurationError, match=r"kd must be >= 0 command unit s, got -1"):
        replace(coupled(pid()), kd=-1.0)
