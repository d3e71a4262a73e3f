"""PID on every axis: discretisation against plain NumPy, placement, limits, messages."""

import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contourlab.configuration import replace
from contourlab.contours import Circle, Line
from contourlab.controllers import AxisPid, Cascade
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines import linear_motor_stage
from contourlab.machines.base import NominalModel
from contourlab.testing.controllers import check_controller
from contourlab.testing.protocol import run
from contourlab.testing.samples import make_samples, sample_at

T = 1e-3


def model(**changes):
    fields = {
        "mass": [0.8, 1.5], "viscous": [4.0, 7.0], "coulomb": [0.3, 0.2], "gain": [2.0, 1.5],
        "command_limit": [1e3, 1e3], "command": "voltage",
    }  # fmt: skip
    return NominalModel(**(fields | changes))


def full(**changes):
    fields = {
        "model": model(), "kp": [300.0, 500.0], "ki": 4000.0, "kd": [6.0, 9.0],
        "derivative_cutoff_hz": 80.0, "velocity_feed_forward": 0.9,
        "acceleration_feed_forward": [0.8, 0.7], "friction_feed_forward": 0.6,
        "friction_velocity": 0.02,
    }  # fmt: skip
    return AxisPid(**(fields | changes))


# all four run against plain NumPy below
@pytest.mark.parametrize(("on", "source"), [("error", "position"), ("measurement", "velocity")])
def test_conformance(on, source):
    check_controller(full(derivative_on=on, derivative_source=source))


def by_hand(law, samples, on, source):
    """The same law in NumPy, axis by axis, from its difference equations."""
    n, n_axes = samples.position.shape
    out = np.zeros((n, n_axes))
    for i in range(n_axes):

        def of(name, i=i):
            return float(np.broadcast_to(getattr(law, name), (n_axes,))[i])

        m = law.model
        a = np.exp(-2.0 * np.pi * of("derivative_cutoff_hz") * T)
        integral = 0.0
        r = samples.reference
        for k in range(n):
            e = r.position[k, i] - samples.position[k, i]
            if on == "error":
                s, rate, start = e, r.velocity[k, i] - samples.velocity[k, i], 0.0
            else:
                s = -samples.position[k, i]
                rate = start = -samples.velocity[k, i]
            if k == 0:
                d, last = start, s - T * start
            raw = rate if source == "velocity" else (s - last) / T
            d, last = a * d + (1.0 - a) * raw, s
            v = r.velocity[k, i]
            ff = (
                of("velocity_feed_forward") * m.viscous[i] * v
                + of("acceleration_feed_forward") * m.mass[i] * r.acceleration[k, i]
                + of("friction_feed_forward") * m.coulomb[i] * np.tanh(v / 0.02)
            ) / m.gain[i]
            u = of("kp") * e + of("ki") * integral + of("kd") * d + ff
            out[k, i] = np.clip(u, -m.command_limit[i], m.command_limit[i])
            if not (u - out[k, i]) * e > 0.0:
                integral += T * e
    return out


@pytest.mark.parametrize("on", ["error", "measurement"])
@pytest.mark.parametrize("source", ["position", "velocity"])
@pytest.mark.parametrize("limit", [1e3, 0.4])
def test_against_numpy(on, source, limit):
    law = full(
        model=model(command_limit=[limit, limit]), derivative_on=on, derivative_source=source
    )
    samples = make_samples(Circle(radius=0.01), 80, T)
    commands, _ = run(law.bind(Circle(radius=0.01), T), samples)
    assert_allclose(commands, by_hand(law, samples, on, source), rtol=0, atol=1e-11)
    if limit < 1.0:
        assert np.max(np.abs(commands)) == limit


def test_the_derivative_filter_is_exact_for_a_ramp():
    """A ramp that starts at sample 0 after rest: D(t) = slope (1 - exp(-N t))."""
    law = AxisPid(model=model(), kp=0.0, kd=1.0, derivative_cutoff_hz=30.0)
    line = Line(start=(0.0, 0.0), end=(1.0, 1.0))
    n, slope = 50, np.array([0.02, -0.01])
    time = np.arange(n) * T
    samples = make_samples(line, n, T, error=time[:, None] * slope)
    commands, _ = run(law.bind(line, T), samples)
    exact = slope * (1.0 - np.exp(-2.0 * np.pi * 30.0 * time))[:, None]
    # positions of a metre, rounded, divided by the sample time
    assert_allclose(commands, exact, rtol=0, atol=1e-12)


def test_no_cutoff_is_the_backward_difference():
    law = AxisPid(model=model(), kp=0.0, kd=2.0)
    line = Line(start=(0.0, 0.0), end=(1.0, 1.0))
    samples = make_samples(line, 20, T)
    error = samples.reference.position - samples.position
    commands, _ = run(law.bind(line, T), samples)
    assert_allclose(commands[1:], 2.0 * np.diff(error, axis=0) / T, rtol=0, atol=1e-12)
    assert_array_equal(commands[0], 0.0)


def test_pole_placement_gives_the_gains_that_ghaffari_and_ulsoy_print():
    """Section IV-A prints 8.08 + 93.2/s + 0.24 s and 9.36 + 108/s + 0.3 s.

    The poles (s + 60)(s² + 28 s + 400) are not in the paper: they are those that give its digits.
    """
    axes = NominalModel(
        mass=[0.040, 0.045], viscous=[1.0, 1.0], coulomb=[0.0, 0.0], gain=[10.3, 10.0],
        command_limit=[np.inf, np.inf], command="voltage",
    )  # fmt: skip
    law = AxisPid.by_pole_placement(axes, 20.0 / (2.0 * np.pi), damping=0.7, integral_pole=3.0)
    assert_allclose(law.kp, [8.08, 9.36], atol=0.005)
    assert_allclose(law.ki, [93.2, 108.0], atol=0.05)
    assert_allclose(law.kd, [0.24, 0.30], atol=0.005)


def test_pole_placement_places_the_poles():
    law = AxisPid.by_pole_placement(model(), [12.0, 20.0], damping=0.8, integral_pole=0.7)
    m = law.model
    for i, hz in enumerate([12.0, 20.0]):
        w = 2.0 * np.pi * hz
        polynomial = [
            m.mass[i], m.viscous[i] + m.gain[i] * law.kd[i], m.gain[i] * law.kp[i],
            m.gain[i] * law.ki[i],
        ]  # fmt: skip
        wanted = np.poly([-0.7 * w, *np.roots([1.0, 1.6 * w, w**2])])
        assert_allclose(polynomial, m.mass[i] * wanted, rtol=1e-12)


def closed_loop(law, reference, n, disturbance=0.0, x0=0.0):
    """One axis, M x'' + B x' = K (u + d), exact zero-order hold; positions and commands."""
    m = law.model
    a, b = float(m.viscous[0] / m.mass[0]), float(m.gain[0] / m.mass[0])
    decay, line = np.exp(-a * T), Line(start=(0.0,), end=(1.0,))
    bound = law.bind(line, T)
    base = sample_at(make_samples(line, 2, T), 0)

    def sample(k, x, v):
        r, rd = reference(k * T)
        point = jax.tree.map(jnp.zeros_like, base.reference)
        point = type(point)(
            point.parameter, point.parameter_rate, point.parameter_acceleration,
            jnp.array([r]), jnp.array([rd]), point.acceleration, point.jerk,
        )  # fmt: skip
        return type(base)(
            time=jnp.asarray(k * T), reference=point, geometry=base.geometry,
            preview=base.preview, position=x[None], velocity=v[None],
        )  # fmt: skip

    def step(carry, k):
        x, v, state = carry
        u, state = bound.step(state, sample(k, x, v))
        drive = b * (u[0] + disturbance)
        new_x = x + drive / a * T + (v - drive / a) * (1.0 - decay) / a
        new_v = drive / a + (v - drive / a) * decay
        return (new_x, new_v, state), (x, u[0])

    x, v = jnp.asarray(x0), jnp.zeros(())
    start = (x, v, bound.init(sample(0, x, v)))
    (_, _, state), (xs, us) = jax.lax.scan(step, start, jnp.arange(n))
    return np.asarray(xs), np.asarray(us), state


def one_axis(limit=np.inf):
    return NominalModel(
        mass=[0.8], viscous=[4.0], coulomb=[0.0], gain=[2.0], command_limit=[limit],
        command="voltage",
    )  # fmt: skip


def test_the_integral_removes_a_constant_disturbance():
    law = AxisPid.by_pole_placement(one_axis(), 10.0)
    xs, us, _ = closed_loop(law, lambda t: (0.0 * t, 0.0 * t), 1500, disturbance=0.7)
    assert np.max(np.abs(xs)) > 1e-5  # it is felt
    assert abs(xs[-1]) < 1e-12
    assert_allclose(us[-1], -0.7, rtol=1e-9)


def test_without_integral_and_feed_forward_a_ramp_lags_by_b_v_over_k_kp():
    law = AxisPid(model=one_axis(), kp=200.0, kd=10.0)
    xs, _, _ = closed_loop(law, lambda t: (0.1 * t, 0.1 + 0.0 * t), 2000)
    assert_allclose(0.1 * 1999 * T - xs[-1], 4.0 * 0.1 / (2.0 * 200.0), rtol=1e-9)
    fed = replace(law, velocity_feed_forward=1.0)
    xs, _, _ = closed_loop(fed, lambda t: (0.1 * t, 0.1 + 0.0 * t), 2000)
    assert abs(0.1 * 1999 * T - xs[-1]) < 1e-12


def test_anti_windup_a_long_step_at_the_limit_overshoots_little():
    """A step that saturates for most of the way: with windup it would overshoot by a half."""
    law = AxisPid.by_pole_placement(one_axis(limit=1.0), 5.0)
    xs, us, state = closed_loop(law, lambda t: (0.1 + 0.0 * t, 0.0 * t), 3000)
    assert np.sum(us == 1.0) > 50
    assert np.max(xs) < 0.125
    assert abs(xs[-1] - 0.1) < 1e-9
    wound = np.cumsum(0.1 - xs)[: np.argmax(us < 1.0)].max() * T
    assert np.abs(float(state.integral[0])) < wound  # what it would have collected


def test_status_says_when_an_axis_is_at_its_limit():
    line = Line(start=(0.0, 0.0), end=(1.0, 1.0))
    bound = AxisPid(model=model(command_limit=[1.0, 1e3]), kp=1e3).bind(line, T)
    for error, status in ((0.9e-3, 0), (1.1e-3, 1)):
        sample = sample_at(make_samples(line, 3, T, error=(error, 0.0)), 1)
        command, state = bound.step(bound.init(sample), sample)
        assert int(bound.status(state)) == status
        assert_allclose(command, [min(1.0, 1e3 * error), 0.0], rtol=1e-9)
    assert bound.statuses[status] == "saturated"


def test_messages():
    with pytest.raises(ConfigurationError, match=r"kp must be >= 0 command unit per m, got -1"):
        AxisPid(model=model(), kp=-1.0)
    with pytest.raises(ConfigurationError, match=r"velocity_feed_forward must be <= 1, got 100"):
        AxisPid(model=model(), kp=1.0, velocity_feed_forward=100.0)
    with pytest.raises(ConfigurationError, match=r"Allowed: error, measurement"):
        AxisPid(model=model(), kp=1.0, derivative_on="errors")
    with pytest.raises(RefusedError, match=r"takes a position"):
        AxisPid(model=model(command="position"), kp=1.0)
    with pytest.raises(ConfigurationError, match=r"kp must be one number or one for each of the 2"):
        AxisPid(model=model(), kp=[1.0, 2.0, 3.0]).bind(Line(start=(0, 0), end=(1, 1)), T)
    with pytest.raises(ConfigurationError, match=r"bandwidth_hz must be >= 0.\d+ Hz, got 0.01"):
        AxisPid.by_pole_placement(model(), 0.01)
    with pytest.raises(ConfigurationError, match=r"damping must be > 0, got -1"):
        AxisPid.by_pole_placement(model(), 10.0, damping=-1)


@pytest.mark.parametrize("name", ["bandwidth_hz", "damping", "integral_pole"])
def test_placement_wants_one_value_per_axis(name):
    values = {"bandwidth_hz": 20.0}
    with pytest.raises(ConfigurationError, match=rf"{name} must be one number .* the 2 axes"):
        AxisPid.by_pole_placement(model(), **(values | {name: [10.0, 20.0, 30.0]}))
    with pytest.raises(ConfigurationError, match=rf"{name} must be a number, got 'a'"):
        AxisPid.by_pole_placement(model(), **(values | {name: "a"}))


def test_a_machine_is_no_model(monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for a user
    machine = linear_motor_stage()
    message = "model must be a NominalModel, such as machine.nominal, got Machine"
    with pytest.raises(ConfigurationError, match=message):
        AxisPid(model=machine, kp=1.0)
    with pytest.raises(ConfigurationError, match=message):
        AxisPid.by_pole_placement(machine, 20.0)
    with pytest.raises(ConfigurationError, match=message):
        Cascade.by_bandwidth(machine, 20.0, 10.0)
    for gain in ("a", None):
        with pytest.raises(ConfigurationError, match=f"kp must be a number, got {gain!r}"):
            AxisPid(model=machine.nominal, kp=gain)


def test_gains_in_a_list_of_one_hold_for_every_axis_and_batches_are_not_bound():
    line = Line(start=(0.0, 0.0), end=(0.1, 0.1))
    assert_array_equal(AxisPid(model=model(), kp=[3.0]).bind(line, T).kp, [3.0, 3.0])
    with pytest.raises(ConfigurationError, match=r"kp must be one number .* got shape \(4, 2\)"):
        AxisPid(model=model(), kp=np.ones((4, 2))).bind(line, T)


def test_stiffness_is_fed_forward_and_placed_with_the_poles():
    spring = model(stiffness=[50.0, 80.0])
    fields = {"kp": 0.0, "ki": 0.0, "kd": 0.0, "acceleration_feed_forward": 0.0,
              "friction_feed_forward": 0.0, "velocity_feed_forward": 1.0}  # fmt: skip
    line = Line(start=(0.01, 0.02), end=(0.04, 0.03))
    law = full(model=spring, **fields)
    samples = make_samples(line, 10, T, law.needs)
    commands, _ = run(law.bind(line, T), samples)
    wanted = (
        np.array([50.0, 80.0]) * samples.reference.position
        + np.array([4.0, 7.0]) * samples.reference.velocity
    ) / np.array([2.0, 1.5])
    assert_allclose(commands, wanted, rtol=1e-12)
    placed = AxisPid.by_pole_placement(spring, 10.0)
    # M s³ + (B + K kd) s² + (S + K kp) s + K ki has the three roots
    omega = 2.0 * np.pi * 10.0
    for axis in range(2):
        m, b, s, k = (float(np.asarray(getattr(spring, name))[axis])
                      for name in ("mass", "viscous", "stiffness", "gain"))  # fmt: skip
        gains = [
            float(np.broadcast_to(getattr(placed, name), 2)[axis]) for name in ("kp", "ki", "kd")
        ]
        found = np.roots([m, b + k * gains[2], s + k * gains[0], k * gains[1]])
        wanted = np.roots(np.convolve([1.0, omega], [1.0, 1.4 * omega, omega**2]))
        assert_allclose(np.sort_complex(found), np.sort_complex(wanted), rtol=1e-9)
    with pytest.raises(ConfigurationError, match="own stiffness is more than the poles ask for"):
        AxisPid.by_pole_placement(model(stiffness=[1e6, 0.0]), 10.0)
    with pytest.raises(RefusedError, match="by_bandwidth is for axes without stiffness"):
        Cascade.by_bandwidth(spring, 40.0, 40.0)
