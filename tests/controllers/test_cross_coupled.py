"""Cross-coupling: the classical scalar law in the plane, transport in space, limits, refusals."""

import dataclasses
from itertools import pairwise
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.configuration import replace
from contourlab.contour_errors import OsculatingCircleEstimator, TangentEstimator
from contourlab.contours import Circle, Ellipse, Helix, Line
from contourlab.controllers import AxisPid, Cascade, CrossCoupled
from contourlab.controllers.cross_coupled import transport
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel
from contourlab.testing.controllers import check_controller
from contourlab.testing.protocol import run
from contourlab.testing.samples import make_samples, sample_at

T = 1e-3


def model(n=2, limit=1e4, command="voltage"):
    return NominalModel(
        mass=0.8 + 0.2 * np.arange(n), viscous=4.0 + np.arange(n), coulomb=np.full(n, 0.3),
        gain=np.full(n, 2.0), command_limit=np.full(n, limit), command=command,
    )  # fmt: skip


def pid(n=2, limit=1e4):
    return AxisPid(
        model=model(n, limit), kp=300.0, ki=4000.0, kd=6.0, derivative_cutoff_hz=80.0,
        velocity_feed_forward=0.9, acceleration_feed_forward=0.8, friction_feed_forward=0.6,
        friction_velocity=0.02,
    )  # fmt: skip


def coupled(axis, estimator=None, **changes):
    gains = {"kp": 500.0, "ki": 6000.0, "kd": 8.0, "derivative_cutoff_hz": 90.0} | changes
    return CrossCoupled(axis=axis, estimator=estimator or TangentEstimator(), **gains)


@pytest.mark.parametrize("form", ["normal", "vector"])
def test_conformance_in_the_plane(form):
    check_controller(coupled(pid(), OsculatingCircleEstimator(), form=form))


def test_conformance_in_space_around_a_cascade():
    axis = Cascade(
        model=model(3), position_gain=40.0, velocity_proportional=20.0, velocity_integral=300.0,
        velocity_feed_forward=0.7, acceleration_feed_forward=0.8, friction_feed_forward=0.5,
        friction_velocity=0.02,
    )  # fmt: skip
    check_controller(coupled(axis, kp=[500.0, 400.0, 300.0]))


@pytest.mark.parametrize("estimator", [TangentEstimator(), OsculatingCircleEstimator()])
def test_in_the_plane_it_is_a_pid_on_the_signed_error_along_the_left_normal(estimator):
    contour = Ellipse(semi_axes=(0.03, 0.01))
    axis = pid()
    law = coupled(axis, estimator)
    samples = make_samples(contour, 120, T, law.needs)
    commands, _ = run(law.bind(contour, T), samples)
    by_axes, _ = run(axis.bind(contour, T), samples)
    decay = np.exp(-2.0 * np.pi * 90.0 * T)
    integral = derivative = 0.0
    last, out = None, []
    for k in range(120):
        sample = sample_at(samples, k)
        tangent = np.asarray(sample.geometry[1]) / np.linalg.norm(sample.geometry[1])
        normal = np.array([-tangent[1], tangent[0]])
        e = normal @ np.asarray(estimator.estimate(sample))
        last = e if last is None else last
        derivative = decay * derivative + (1.0 - decay) * (e - last) / T
        last = e
        out.append(by_axes[k] + normal * (500.0 * e + 6000.0 * integral + 8.0 * derivative))
        integral += T * e
    assert_allclose(commands, out, rtol=0, atol=1e-10 * np.max(np.abs(commands)))


def test_what_the_integral_does_with_a_constant_radial_error():
    """Normal form: it grows as on a line. Vector form: it turns, and stays below 2 e / Ω."""
    circle, n, offset = Circle(radius=0.02), 400, 1e-5
    law = coupled(pid(limit=1e9), kp=0.0, kd=0.0, ki=1.0)
    samples = make_samples(circle, n, T, law.needs, error=(0.0, 0.0))
    inward = -samples.reference.position / 0.02
    actual = samples.reference.position - offset * inward
    samples = eqx.tree_at(lambda s: s.position, samples, actual)
    _, normal = run(law.bind(circle, T), samples)
    assert_allclose(normal.integral, (n - 0) * T * offset * inward[-1], rtol=1e-9)
    _, vector = run(dataclasses.replace(law, form="vector").bind(circle, T), samples)
    turned = np.sum(inward, axis=0) * T * offset
    assert_allclose(vector.integral, turned, rtol=1e-9)
    assert np.linalg.norm(turned) < 0.5 * np.linalg.norm(normal.integral)


def test_transport_is_a_rotation_of_the_normal_plane():
    helix = Helix(radius=0.02, pitch=0.03, turns=3.0)
    tangents = [np.asarray(helix.frenet(p).tangent) for p in np.linspace(0.0, 6.0, 50)]
    rng = np.random.default_rng(1)
    v, w = rng.normal(size=(2, 3))
    v, w = (x - tangents[0] * (tangents[0] @ x) for x in (v, w))
    before = np.array([v @ v, v @ w, w @ w])
    for a, b in pairwise(tangents):
        v, w = np.asarray(transport(v, a, b)), np.asarray(transport(w, a, b))
        assert abs(v @ b) < 1e-14
    assert_allclose([v @ v, v @ w, w @ w], before, rtol=1e-13)
    t = tangents[0]
    assert_allclose(transport(v, b, b), v, atol=1e-15)
    back = transport(np.array([0.0, 1.0, 0.0]), np.eye(3)[0], -np.eye(3)[0])
    assert_allclose(back, [0.0, 1.0, 0.0])
    assert np.all(np.isfinite(jax.jacrev(transport, 1)(v, jnp.asarray(t), jnp.asarray(-t))))


def test_steady_contour_error_on_a_line_with_unequal_axes():
    """P axis loops and P coupling on ideal velocity drives: (diag(k_v) + kp n nᵀ) e = v."""
    drives = NominalModel(
        mass=[1e-6, 1e-6], viscous=[1.0, 1.0], coulomb=[0.0, 0.0], gain=[1.0, 1.0],
        command_limit=[np.inf, np.inf], command="velocity",
    )  # fmt: skip
    axis = Cascade(model=drives, position_gain=[20.0, 35.0])
    line = Line(start=(0.0, 0.0), end=(0.3, 0.4))
    t, normal = np.array([0.6, 0.8]), np.array([-0.8, 0.6])
    found = {}
    for kp in (0.0, 100.0):
        law = CrossCoupled(axis=axis, estimator=TangentEstimator(), kp=kp)
        bound = law.bind(line, T)
        base = sample_at(make_samples(line, 3, T, law.needs), 0)

        def sample(x, k, base=base):
            point = dataclasses.replace(base.reference, position=t * 0.1 * k * T, velocity=t * 0.1)
            geometry = jnp.stack([point.position, jnp.asarray(t)])
            return dataclasses.replace(base, reference=point, geometry=geometry, position=x)

        def step(carry, k, bound=bound, sample=sample):
            x, state = carry
            u, state = bound.step(state, sample(x, k))
            return (x + T * u, state), t * 0.1 * k * T - x

        x = jnp.zeros(2)
        _, errors = jax.lax.scan(step, (x, bound.init(sample(x, 0.0))), jnp.arange(2000.0))
        exact = np.linalg.solve(np.diag([20.0, 35.0]) + kp * np.outer(normal, normal), 0.1 * t)
        assert_allclose(errors[-1], exact, rtol=1e-9)
        found[kp] = abs(normal @ exact)
    assert found[100.0] < 0.25 * found[0.0]


def test_the_axis_law_settles_on_the_whole_command():
    """The coupling alone drives an axis to its limit; the axis integral must see it."""
    line = Line(start=(0.0, 0.0), end=(1.0, 0.0))
    axis = AxisPid(model=model(limit=1.0), kp=1.0, ki=1.0)
    for kp, held in ((10.0, False), (1e5, True)):
        law = coupled(axis, kp=kp, kd=0.0)
        sample = sample_at(make_samples(line, 3, T, law.needs, error=(1e-4, 1e-4)), 1)
        bound = law.bind(line, T)
        command, state = bound.step(bound.init(sample), sample)
        assert_allclose(state.axis.integral, [1e-7, 0.0 if held else 1e-7], rtol=1e-9)
        assert_allclose(state.integral, [0.0, 0.0 if held else 1e-7], rtol=1e-9, atol=1e-20)
        assert int(bound.status(state)) == held
        assert abs(float(command[1])) <= 1.0


def test_telemetry_is_the_estimate():
    contour = Circle(radius=0.02)
    law = coupled(pid())
    samples = make_samples(contour, 5, T, law.needs)
    bound = law.bind(contour, T)
    sample = sample_at(samples, 2)
    _, state = bound.step(bound.init(sample), sample)
    assert_allclose(
        bound.telemetry(state)["contour_error_estimate"], TangentEstimator().estimate(sample)
    )


def test_engaged_late_it_is_the_axis_law_until_then_and_its_integral_starts_there():
    contour = Ellipse(semi_axes=(0.03, 0.01))
    axis, start = pid(), 40
    law = coupled(axis, engage_time=start * T)
    samples = make_samples(contour, 80, T, law.needs)
    commands, state = run(law.bind(contour, T), samples)
    by_axes, _ = run(axis.bind(contour, T), samples)
    whole, from_the_start = run(replace(law, engage_time=0.0).bind(contour, T), samples)
    np.testing.assert_array_equal(commands[:start], by_axes[:start])
    # without integral and derivative's past the two would agree from there on
    plain = {"ki": 0.0, "kd": 0.0}
    late, _ = run(replace(law, **plain).bind(contour, T), samples)
    early, _ = run(replace(law, engage_time=0.0, **plain).bind(contour, T), samples)
    assert_allclose(late[start:], early[start:], rtol=1e-12)
    assert np.all(np.abs(commands[start] - by_axes[start]) > 1e-3)
    ratio = np.linalg.norm(state.integral) / np.linalg.norm(from_the_start.integral)
    assert 0.2 < ratio < 0.95
    assert np.all(np.isfinite(whole))


def test_needs_are_the_union():
    needs = coupled(pid(), OsculatingCircleEstimator()).needs
    assert (needs.derivatives, needs.preview, needs.contour) == (2, 0, False)
    assert needs.command == "voltage"
    assert coupled(pid()).needs.derivatives == 1


def test_messages():
    with pytest.raises(RefusedError, match=r"3 axes, the contour 2 coordinates"):
        coupled(pid(3)).bind(Circle(radius=0.1), T)
    with pytest.raises(ConfigurationError, match=r"kd must be >= 0 command unit per m/s, got -2"):
        coupled(pid(), kd=-2.0)
    with pytest.raises(ConfigurationError, match=r"Allowed: normal, vector"):
        coupled(pid(), form="scalar")
    # called by hand: the test run's own type check would speak first
    with pytest.raises(ConfigurationError, match=r"axis must be an axis law.*CrossCoupled"):
        CrossCoupled.__check_init__(SimpleNamespace(axis=coupled(pid()), estimator=None))
    with pytest.raises(ConfigurationError, match=r"estimator must be an estimator.*got 'tangent'"):
        CrossCoupled.__check_init__(SimpleNamespace(axis=pid(), estimator="tangent"))
    with pytest.raises(ConfigurationError, match=r"derivative_cutoff_hz must be one number"):
        coupled(pid(), derivative_cutoff_hz=[1.0, 2.0]).bind(Circle(radius=0.1), T)
