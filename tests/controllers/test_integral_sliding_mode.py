"""Integral sliding mode: difference equations, Theorem 1 in numbers, condition (23), stability."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.configuration import replace
from contourlab.contours import Circle, Line
from contourlab.controllers import CrossCoupled, IntegralSlidingMode
from contourlab.controllers.sliding_mode_stability import sampled_map
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines import SineDisturbance, StepDisturbance
from contourlab.machines.base import NominalModel
from contourlab.machines.published import ghaffari_two_axes
from contourlab.testing.controllers import check_controller
from contourlab.testing.protocol import run
from contourlab.testing.samples import make_samples, rest_to_rest, sample_at, standing

T = 1e-3
LINE = Line(start=(0.0, 0.0), end=(1.0, 1.0))


def model(**changes):
    fields = {
        "mass": [0.8, 1.5], "viscous": [4.0, 7.0], "coulomb": [0.3, 0.2], "gain": [2.0, 1.5],
        "stiffness": [9.0, 12.0], "command_limit": [1e3, 1e3], "command": "voltage",
    }  # fmt: skip
    return NominalModel(**(fields | changes))


def full(**changes):
    fields = {
        "model": model(), "error_rate": [14.0, 11.0], "integral_rate": [9.0, 13.0],
        "boundary_layer": 2e-3, "disturbance_bound": [0.02, 0.03], "acceleration_rate": 40.0,
        "smoothing_rate": [25.0, 30.0], "friction_feed_forward": 0.7, "friction_velocity": 0.02,
    }  # fmt: skip
    return IntegralSlidingMode(**(fields | changes))


def test_conformance_with_the_least_gain():
    check_controller(full())


@pytest.mark.slow
@pytest.mark.parametrize("form", ["printed", "matched", "none"])
def test_conformance_with_a_given_gain(form):
    rates = {} if form != "none" else {"acceleration_rate": None, "smoothing_rate": None}
    law = full(switching_gain=40.0, disturbance_estimate=form, **rates)
    check_controller(law, inert=("disturbance_bound",))


def by_hand(law, samples, form):
    """The same law in NumPy, axis by axis, from its difference equations."""
    n, n_axes = samples.position.shape
    out = np.zeros((n, n_axes))
    for i in range(n_axes):

        def of(value, i=i):
            return float(np.broadcast_to(value, (n_axes,))[i])

        m, r = law.model, samples.reference
        mass, gain, viscous, spring = (
            of(m.mass), of(m.gain), of(m.viscous), of(m.stiffness)
        )  # fmt: skip
        a, b, mu = of(law.error_rate), of(law.integral_rate), of(law.boundary_layer)
        c, d = of(law.acceleration_rate), of(law.smoothing_rate)
        kappa = of(law.disturbance_bound) / mu + b * mass / gain
        q, delta, rest, omega = 0.0, 0.0, 0.0, -float(samples.velocity[0, i])
        for k in range(n):
            p, v = float(samples.position[k, i]), float(samples.velocity[k, i])
            e, ed = float(r.position[k, i]) - p, float(r.velocity[k, i]) - v
            sigma = ed + a * e + b * q
            s = mu * np.clip(sigma / mu, -1.0, 1.0)
            friction = 0.7 * of(m.coulomb) / gain * np.tanh(float(r.velocity[k, i]) / 0.02)
            u = (
                (mass * (float(r.acceleration[k, i]) + (a + b) * ed + a * b * e))
                + viscous * (float(r.velocity[k, i]) - ed) + spring * p
            ) / gain + kappa * s + friction - delta  # fmt: skip
            limit = of(m.command_limit)
            out[k, i] = np.clip(u, -limit, limit)
            push = -b * q + s
            slow = np.exp(-c * T)
            known = (viscous * v + spring * p) / gain - (out[k, i] - friction)
            xi = mass / gain * (1.0 if form == "printed" else c) * (omega + v) + known
            if form == "matched":
                lever = (mass + 0.5 * T * viscous) / gain * (1.0 - slow) / T
                xi = lever * (omega + v) + rest
            rest = slow * rest + (1.0 - slow) * known
            if not (u - out[k, i]) * push > 0.0:
                q += (1.0 - np.exp(-b * T)) / b * push
            omega += (1.0 - np.exp(-c * T)) * -(omega + v)
            delta += (1.0 - np.exp(-d * T)) * (xi - delta)
    return out


@pytest.mark.parametrize(
    ("form", "limit"),
    [
        ("corrected", 1e3),
        ("corrected", 0.15),
        ("printed", 1e3),
        ("matched", 1e3),
        ("matched", 0.15),
    ],
)
def test_against_numpy(form, limit):
    law = full(model=model(command_limit=[limit, limit]), disturbance_estimate=form)
    circle = Circle(radius=0.01)
    samples = make_samples(circle, 80, T, error=make_error(80))
    commands, state = run(law.bind(circle, T), samples)
    assert_allclose(commands, by_hand(law, samples, form), rtol=0, atol=1e-11)
    assert (np.max(np.abs(commands)) == limit) == (limit < 1.0)
    assert np.any(np.abs(np.asarray(state.integral)) > 0.0)


def make_error(n):
    """Errors that leave the layer and come back."""
    time = np.arange(n)[:, None] / n
    return 1.5e-4 * np.sin(2.0 * np.pi * time * np.array([1.0, 1.7]) + np.array([0.4, 1.4]))


MACHINE = ghaffari_two_axes()
STEP = 2e-4
SIZES = {
    "mass": np.array([0.04, 0.045]) / np.array([10.3e-3, 10.0e-3]), "rate": np.array([12.5, 11.0])
}  # fmt: skip


def paper_law(estimate="corrected", **changes):
    fields = {
        "model": MACHINE.nominal, "error_rate": SIZES["rate"], "integral_rate": [15.0, 9.0],
        "boundary_layer": 1e-3, "disturbance_bound": 0.25, "disturbance_estimate": estimate,
    }  # fmt: skip
    return IntegralSlidingMode(**(fields | changes))


def rates(estimate):
    """Rates of the estimate that differ from each other and from axis to axis."""
    given = {"acceleration_rate": [35.0, 28.0], "smoothing_rate": [20.0, 31.0]}
    return {} if estimate == "none" else given


def held_still(law, disturbances, duration):
    """The machine under a law that is to keep it where it is."""
    reference = standing(LINE, round(duration / STEP) + 1, STEP)
    return cl.simulate(MACHINE, law, reference, disturbances=disturbances)


def errors_of(recording):
    return np.asarray(recording["tracking_error"])


@pytest.mark.parametrize(
    ("estimate", "size"),
    # 0.28 V is beyond the bound of (23), 0.25 V, and within κ μ, 0.2905 V: (23) is sufficient
    [("corrected", 0.2), ("none", 0.2), ("none", 0.28)],
)
def test_a_constant_disturbance_leaves_no_error(estimate, size):
    """Theorem 1, inside |D| < κ μ: (T) and (R) vanish at s = 0."""
    push = [StepDisturbance(axis=axis, amplitude=-size) for axis in (0, 1)]
    recording = held_still(paper_law(estimate), push, 2.5)
    error = np.abs(errors_of(recording))
    assert np.max(error) > 1e-5  # it is felt
    assert np.max(error[-1]) < 1e-12
    surface = np.asarray(recording["sliding_surface"])[-1]
    if estimate == "none":  # σ = -D / κ holds the axis
        gain = 250.0 + np.array([15.0, 9.0]) * SIZES["mass"]
        assert_allclose(surface, size / (gain * 1e-3), rtol=1e-9)
    else:
        assert_allclose(np.asarray(recording["disturbance_estimate"])[-1], -size, rtol=1e-9)


def response(law, s, estimate):
    """(T) or (R), from disturbance to tracking error, per axis [m/V]."""
    per_mass = 1.0 / SIZES["mass"]
    a, b = np.asarray(law.error_rate), np.asarray(law.integral_rate)
    layer = (250.0 + b * SIZES["mass"]) * per_mass
    base = (s + a) * (s + b) * (s + layer)
    if estimate == "none":
        return -per_mass * s / base
    c, d = np.asarray(law.acceleration_rate), np.asarray(law.smoothing_rate)
    if estimate == "matched":
        return -per_mass * s**2 * (s + c + d) / (base * (s + c) * (s + d))
    return -per_mass * s**2 * (s + c) / (base * (s + c) * (s + d) - d * s**4)


@pytest.mark.parametrize("estimate", ["corrected", "matched", "none"])
@pytest.mark.parametrize("hz", [1.0, 8.0])
def test_a_sine_leaves_the_stated_residual(estimate, hz):
    law = paper_law(estimate, **rates(estimate))
    push = [SineDisturbance(axis=axis, amplitude=0.1, frequency_hz=hz) for axis in (0, 1)]
    recording = held_still(law, push, 3.0)
    time = np.asarray(recording["time"])
    last = time >= 2.0 - 1e-9
    wave = np.exp(-2j * np.pi * hz * time[last])
    found = 2.0 * np.mean(errors_of(recording)[last] * wave[:, None], axis=0)
    exact = 0.1 * response(law, 2j * np.pi * hz, estimate) / 1j
    # the disturbance and the command are held: late by up to a sample, ω T = 0.01
    assert_allclose(found, exact, rtol=0, atol=0.02 * np.max(np.abs(exact)))


def test_without_the_estimate_a_ramp_leaves_what_the_module_says():
    """A slow sine is a ramp about its zero: |e| = D' / (a b κ)."""
    law, omega = paper_law("none"), 2.0 * np.pi * 0.02
    gain = 250.0 + np.array([15.0, 9.0]) * SIZES["mass"]
    slow = np.abs(response(law, 1j * omega, "none"))
    assert_allclose(slow, omega / (SIZES["rate"] * np.array([15.0, 9.0]) * gain), rtol=1e-3)


def test_beyond_the_layer_an_error_stays():
    law = paper_law("none")
    push = [StepDisturbance(axis=axis, amplitude=0.6) for axis in (0, 1)]
    recording = held_still(law, push, 3.0)
    b = np.array([15.0, 9.0])
    gain = 250.0 + b * SIZES["mass"]
    stays = (0.6 - gain * 1e-3) / (SIZES["mass"] * SIZES["rate"] * b)
    assert_allclose(errors_of(recording)[-1], -stays, rtol=1e-6)


def test_the_printed_estimate_is_off_while_an_axis_accelerates():
    """Δ takes (1 - 1/c) (M/K) V' for a disturbance; corrected it does not."""
    c = np.array([25.0, 22.2])
    acceleration = np.array([0.02, -0.01])
    n = 2000
    time = np.arange(n)[:, None] * T
    velocity, position = jnp.asarray(acceleration * time), jnp.zeros((n, 2))
    for form, share in (("corrected", 0.0), ("printed", 1.0 - 1.0 / c)):
        law = paper_law(form, acceleration_rate=c, smoothing_rate=200.0)
        estimator = law.bind(LINE, T).estimator
        needed = SIZES["mass"] * acceleration + np.asarray(estimator.viscous) * velocity

        def step(state, row, estimator=estimator):
            position, velocity, command = row
            return estimator.step(state, position, velocity, command), None

        start = estimator.init(jnp.zeros(2))
        state, _ = jax.lax.scan(step, start, (position, velocity, jnp.asarray(needed)))
        wanted = -share * SIZES["mass"] * acceleration
        # a sampled derivative of a ramp is late by half a sample: c T / 2 of the whole
        assert_allclose(state.disturbance, wanted, atol=0.015 * np.max(SIZES["mass"]) * 0.02)


def test_jerk_is_a_disturbance_to_the_corrected_estimate_and_not_to_the_matched():
    """Without any disturbance: (M/K) jerk / c, behind the filters, against nothing."""
    line = Line(start=(0.0, 0.0), end=(0.004, 0.003))
    reference = rest_to_rest(line, 5001, STEP, share=1.0)
    seen = {}
    for form in ("corrected", "matched"):
        recording = cl.simulate(MACHINE, paper_law(form), reference)
        seen[form] = np.asarray(recording["disturbance_estimate"])
    top = np.max(np.abs(reference.jerk), axis=0) * SIZES["mass"] / (2.0 * SIZES["rate"])
    assert np.all(np.max(np.abs(seen["corrected"]), axis=0) > 0.5 * top)
    assert np.all(np.max(np.abs(seen["matched"]), axis=0) < 0.005 * top)


@pytest.mark.parametrize("estimate", ["corrected", "printed", "matched", "none"])
def test_the_sampled_map_is_that_of_the_loop(estimate):
    """Against the derivative of one step of law and machine."""
    law = paper_law(estimate, **rates(estimate)).bind(LINE, T)
    machine = MACHINE.bind(T)
    base = sample_at(make_samples(LINE, 3, T, error=np.zeros(2)), 0)
    zero = jnp.zeros(2)

    def step(x):
        p, v, q, slow, delta, rest = x
        sample = dataclasses.replace(
            base, position=p, velocity=v,
            reference=dataclasses.replace(
                base.reference, position=zero, velocity=zero, acceleration=zero
            ),
        )  # fmt: skip
        state = law.init(sample)
        estimate = state.estimate._replace(lagging=slow, disturbance=delta, rest=rest)
        command, after = law.step(state._replace(integral=q, estimate=estimate), sample)
        motion = machine.init(p, jax.random.key(0))
        axes = dataclasses.replace(motion.axes, position=p, velocity=v)
        axes = machine.dynamics.advance(axes, (command,), zero)
        return (
            axes.position, axes.velocity, after.integral, after.estimate.lagging,
            after.estimate.disturbance, after.estimate.rest,
        )  # fmt: skip

    size = {"none": 3, "matched": 6}.get(estimate, 5)
    blocks = jax.jacobian(step)((zero,) * 6)
    for axis in (0, 1):
        exact = [[float(blocks[i][j][axis, axis]) for j in range(size)] for i in range(size)]
        assert_allclose(sampled_map(law, MACHINE.nominal, T, axis), exact, atol=1e-12, rtol=1e-12)


def test_a_layer_too_thin_for_the_sample_time_is_refused_and_does_swing():
    law = paper_law(boundary_layer=2e-5)
    law.bind(LINE, 1e-5)
    with pytest.raises(RefusedError, match=r"axis 0 .* not stable at a sample time of 0.001 s"):
        law.bind(LINE, T)
    radii = [
        max(
            np.abs(np.linalg.eigvals(sampled_map(paper_law().bind(LINE, T), MACHINE.nominal, T, i)))
        )
        for i in (0, 1)
    ]
    assert max(radii) < 1.0


def test_by_bandwidth_places_the_layer():
    law = IntegralSlidingMode.by_bandwidth(
        model(), [6.0, 9.0], disturbance_bound=[0.1, 0.2], layer_ratio=4.0,
        disturbance_estimate="none",
    )  # fmt: skip
    bound = law.bind(LINE, T)
    for axis, hz in enumerate((6.0, 9.0)):
        omega = 2.0 * np.pi * hz
        found = np.sort(-np.log(np.linalg.eigvals(sampled_map(bound, law.model, T, axis)).real) / T)
        # sampled poles of a continuous design: off by ω T / 2 and, for a double pole, by its root
        assert_allclose(found, omega * np.array([1.0, 1.0, 4.0]), rtol=0.25)
        product = np.prod(found)
        assert_allclose(product, 4.0 * omega**3, rtol=0.25)
        gain = float(bound.switching_gain[axis])
        m, k = float(law.model.mass[axis]), float(law.model.gain[axis])
        assert_allclose(gain * k / m, 4.0 * omega, rtol=1e-12)
        least = [0.1, 0.2][axis] / float(bound.boundary_layer[axis]) + omega * m / k
        assert_allclose(gain, least, rtol=1e-12)


def test_condition_23_names_the_axis_and_the_gain():
    least = 250.0 + np.array([15.0, 9.0]) * SIZES["mass"]
    assert_allclose(paper_law().bind(LINE, STEP).switching_gain, least)
    paper_law(switching_gain=least)
    with pytest.raises(
        ConfigurationError,
        match=rf"switching_gain of axis 1 .*>= {least[1]:.6g} for a disturbance_bound of 0.25",
    ):
        paper_law(switching_gain=least * np.array([1.0, 0.99]))
    with pytest.raises(ConfigurationError, match=r"switching_gain of axis 0"):
        replace(paper_law(switching_gain=least), disturbance_bound=0.26)
    with pytest.raises(ConfigurationError, match=r"switching_gain of axis 0"):
        # lanes of a batch are checked as a whole
        paper_law(switching_gain=np.stack([2.0 * least, least * np.array([0.5, 1.0])]))


def test_the_printed_gains_are_those_of_the_condition():
    """Section IV prints a = 12.5, 11.1, κ = 0.2985, 0.3: (23) with a = b = 1 / (2 τ), M = 0.25."""
    tau = np.array([0.040, 0.045])
    law = paper_law(error_rate=0.5 / tau, integral_rate=0.5 / tau)
    assert_allclose(law.error_rate, [12.5, 11.1], atol=0.05)
    assert_allclose(1e-3 * law.bind(LINE, STEP).switching_gain, [0.2985, 0.3], atol=5e-5)


def test_the_estimate_is_told_of_the_coupling_and_of_the_limit():
    """What a coupling adds and what the limit takes is no disturbance."""
    axis = paper_law(model=replace(MACHINE.nominal, command_limit=[0.5, 0.5]))
    law = CrossCoupled(
        axis=axis, estimator=cl.contour_errors.TangentEstimator(), kp=1e5, ki=0.0, kd=0.0
    )
    bound = law.bind(LINE, T)
    sample = sample_at(make_samples(LINE, 3, T, law.needs, error=(1e-4, -1e-4)), 0)
    command, state = bound.step(bound.init(sample), sample)
    assert np.max(np.abs(command)) == 0.5
    smooth = np.asarray(bound.axis.estimator.smoothing_decay)
    known = np.asarray(bound.axis.estimator.viscous) * np.asarray(sample.velocity)
    wanted = (1.0 - smooth) * (known - np.asarray(command))
    assert_allclose(state.axis.estimate.disturbance, wanted, rtol=1e-12)


def test_the_integral_is_held_at_the_limit_and_only_outwards():
    """Standing still, 0.1 mm behind on X; ahead on Y, which has room."""
    for limit, held in ((0.01, True), (10.0, False)):
        law = paper_law("none", model=replace(MACHINE.nominal, command_limit=[limit, 10.0]))
        bound, still = law.bind(LINE, T), standing(LINE, 3, T)
        samples = make_samples(LINE, 3, T, law.needs, error=(1e-4, -1e-4), reference=still)
        sample = sample_at(samples, 0)
        start = bound.init(sample)
        _, state = bound.step(start, sample)
        assert (float(state.integral[0]) == 0.0) == held
        assert float(state.integral[1]) < 0.0
        # with room, σ = 12.5/s 0.1 mm is outside the layer of 1 mm/s
        assert bound.statuses[int(bound.status(state))] == (
            "saturated" if held else "outside the boundary layer"
        )
        inside = state._replace(surface=jnp.full(2, 0.9e-3), saturated=jnp.zeros((), jnp.int32))
        assert int(bound.status(inside)) == 0
        # an integral that leads back is not held: q = 1 mm forgets, whatever the limit
        _, state = bound.step(start._replace(integral=jnp.array([1e-3, 0.0])), sample)
        assert float(state.integral[0]) < 1e-3


def test_messages():
    with pytest.raises(ConfigurationError, match=r"smoothing_rate has no effect with .* 'none'"):
        paper_law("none", smoothing_rate=3.0)
    with pytest.raises(ConfigurationError, match=r"Allowed: corrected, matched, none, printed"):
        paper_law("exact")
    with pytest.raises(ConfigurationError, match=r"boundary_layer must be > 0 m/s, got 0"):
        paper_law(boundary_layer=0.0)
    with pytest.raises(RefusedError, match=r"takes a position"):
        full(model=model(command="position"))
    with pytest.raises(ConfigurationError, match=r"layer_ratio must be > 1"):
        IntegralSlidingMode.by_bandwidth(model(), 10.0, 0.1, layer_ratio=1.0)
    with pytest.raises(ConfigurationError, match=r"error_rate must be one number .* the 2 axes"):
        paper_law(error_rate=[1.0, 2.0, 3.0]).bind(LINE, T)
