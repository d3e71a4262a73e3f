"""What the theory of adaptive robust contouring control promises, seen in closed loops."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.contours import Circle, Ellipse
from contourlab.controllers import (
    DirectAdaptiveRobust,
    FilteredLeastSquares,
    GlobalTaskFrame,
    IntegratedAdaptiveRobust,
    LocalTaskFrame,
    Needs,
)
from contourlab.machines import Drive, Encoder, Machine, NominalModel, RigidAxes
from contourlab.machines.arctan_friction import ArctanFriction
from contourlab.testing.samples import make_samples, sample_at

Q = np.array([[0.0, -1.0], [1.0, 0.0]])
MASS, VISCOUS, COULOMB = np.array([0.12, 0.55]), np.array([0.35, 0.5]), np.array([0.1, 0.13])
ELLIPSE = Ellipse(semi_axes=(0.2, 0.1), center=(0.0, 0.1))
NEEDS = Needs(command="voltage", derivatives=3, contour=True)
MODEL = NominalModel(
    mass=MASS, viscous=VISCOUS, coulomb=COULOMB, gain=np.ones(2),
    command_limit=np.full(2, 1e3), command="voltage",
)  # fmt: skip


def machine(friction=True, velocity="ideal", resolution=0.0):
    dry = ArctanFriction(coulomb=COULOMB, smoothing_velocity=1.0 / 9000.0)
    return Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(mass=MASS, viscous=VISCOUS, friction=dry if friction else None),
        drive=Drive(command="voltage"),
        sensor=Encoder(velocity=velocity, resolution=resolution),
        substeps=5,
    )


@pytest.mark.parametrize("frame", [GlobalTaskFrame(form="implicit"), LocalTaskFrame()])
def test_properties_of_the_dynamics_in_the_frame(frame):
    """P1 to P3, and the regressor of the paper against the law's own, in axes."""
    time = np.arange(400) * 1e-3
    error = 2e-3 * np.stack([np.sin(9 * time), np.cos(7 * time + 1)], 1)
    samples = make_samples(ELLIPSE, 400, 1e-3, NEEDS, error=error)
    bound = cl.replace(frame, rate_from="velocity").bind(ELLIPSE, 1e-3)
    rng = np.random.default_rng(1)
    for k in (50, 200, 333):
        sample = sample_at(samples, k)
        here = bound.coordinates(sample, jnp.zeros((), jnp.int32))
        j, turning = np.asarray(here.jacobian), float(here.turning)
        m_t = j @ np.diag(MASS) @ j.T
        assert_allclose(m_t, m_t.T, atol=1e-16)
        assert_allclose(np.linalg.eigvalsh(m_t), sorted(MASS), rtol=1e-12)  # P1
        j_1 = turning * Q @ j
        c_t = -j @ np.diag(MASS) @ j.T @ j_1 @ j.T
        m_t_1 = j_1 @ np.diag(MASS) @ j.T + j @ np.diag(MASS) @ j_1.T
        skew = m_t_1 - 2.0 * c_t
        assert_allclose(skew + skew.T, 0.0, atol=1e-12 * abs(turning))  # P2
        # P3: M_t r_eq'' + B_t r' + C_t r_eq' + A_t S - d_t is J Y θ, with r_eq of the frame
        theta = rng.normal(size=(4, 2))
        slope, change = rng.normal(size=2), rng.normal(size=2)
        velocity, acceleration = map(np.asarray, here.equivalent_motion(slope, change))
        r_eq_1 = j @ velocity
        r_eq_2 = j_1 @ velocity + j @ acceleration
        mass_t = j @ np.diag(theta[0]) @ j.T
        coriolis = -mass_t @ j_1 @ j.T
        qd = np.asarray(sample.velocity)
        sign = 2 / np.pi * np.arctan(9000 * qd)
        left = (
            mass_t @ r_eq_2 + j @ np.diag(theta[1]) @ qd + coriolis @ r_eq_1
            + j @ (theta[2] * sign) - j @ theta[3]
        )  # fmt: skip
        y = np.stack([acceleration, qd, sign, -np.ones(2)])
        assert_allclose(left, j @ np.sum(theta * y, axis=0), atol=1e-10)


def test_projection_keeps_its_bounds_and_its_inequality_for_diagonal_rates():
    """P4 and P5, θ̃ᵀ (Γ⁻¹ Proj(Γ τ) - τ) ≤ 0, by one step of the direct law, τ = -Y p."""
    rng = np.random.default_rng(2)
    step, inside, limited = 1e-3, 0, 0
    law = DirectAdaptiveRobust(
        model=MODEL, error_decay=(30.0, 30.0), feedback_gain=(5.0, 5.0), parameter_lower=LOWER,
        parameter_upper=UPPER, adaptation_rate=np.ones((4, 2)),
    ).bind(ELLIPSE, step)  # fmt: skip
    samples = make_samples(ELLIPSE, 10, step, NEEDS, error=np.zeros(2))
    sample = sample_at(samples, 0)  # the law needs none of it
    for _ in range(200):
        hat, theta = rng.uniform(LOWER, UPPER), rng.uniform(LOWER, UPPER)
        rate = rng.uniform(0.1, 10.0, (4, 2))
        regressor, push = 10.0 * rng.normal(size=(4, 2)), rng.normal(size=2)
        command = rng.normal(size=2)  # not limited
        adapted = cl.replace(law, rate=rate).adapt(hat, sample, regressor, push, command, command)
        after, tau = np.asarray(adapted), -regressor * push
        assert np.all((after >= LOWER) & (after <= UPPER))  # P4
        # what one clipped step of length T gives is that of its end point: θ̂⁺ - θ
        value = np.sum((after - theta) * ((after - hat) / (step * rate) - tau), axis=0)
        assert np.all(value <= 1e-9)
        free = (after > LOWER) & (after < UPPER)
        assert_allclose(after[free], (hat + step * rate * tau)[free], rtol=1e-12)
        inside, limited = inside + np.sum(free), limited + np.sum(~free)
    assert inside > 100
    assert limited > 100


def test_clipping_loses_the_inequality_for_rates_that_are_not_diagonal():
    """P5 by arithmetic alone: why the rate of the direct law has one number per parameter."""
    rng = np.random.default_rng(2)
    low, high = -np.ones(4), np.ones(4)
    step, broken = 1e-3, 0
    for _ in range(300):
        hat, theta = np.clip(rng.normal(size=4), low, high), rng.uniform(low, high)
        tau, root = rng.normal(size=4) * 1e3, rng.normal(size=(4, 4))
        gamma = root @ root.T + 0.01 * np.eye(4)
        moved = (np.clip(hat + step * gamma @ tau, low, high) - hat) / step
        broken += (hat - theta) @ (np.linalg.solve(gamma, moved) - tau) > 1.0
    assert broken > 0


def closed_loop(law, truth, disturbance, offset, n, period, rate=2.0):
    """V, s and the estimates of a loop that starts off the contour, with true sensors."""
    reference = cl.feedrate.constant_rate(
        ELLIPSE, rate=rate, duration=n * period, sample_time=period
    )
    bound, plant = law.bind(ELLIPSE, period), truth.bind(period)
    frame = cl.replace(law.frame, rate_from="velocity").bind(ELLIPSE, period)
    points = jax.tree.map(jnp.asarray, reference.points)
    rows = jax.vmap(lambda p: ELLIPSE.derivatives(p, 3))(points.parameter)
    start = plant.init(points.position[0] + jnp.asarray(offset), velocity=points.velocity[0])

    @jax.jit
    def run(bound, start, points, rows):
        def sample(state, k):
            at = jax.tree.map(lambda x: x[k], points)
            none = jax.tree.map(lambda x: x[:0], points)
            m = plant.measure(state)
            return cl.recordings.Sample(k * period, at, rows[k], none, m.position, m.velocity)

        def step(carry, k):
            state, memory = carry
            now = sample(state, k)
            here = frame.coordinates(now, jnp.zeros((), jnp.int32))
            s = here.rate + bound.error_decay * here.error
            axes = here.to_axes(s)
            command, memory = bound.step(memory, now)
            state = plant.advance(state, command, disturbance(k * period))
            out = (0.5 * jnp.sum(MASS * axes**2), s, here.error, bound.status(memory),
                   bound.parameters(memory.adaptation))  # fmt: skip
            return (state, memory), out

        first = sample(start, jnp.zeros((), jnp.int32))
        return jax.lax.scan(step, (start, bound.init(first)), jnp.arange(n))[1]

    return tuple(map(np.asarray, run(bound, start, points, rows)))


LOWER = np.stack([0.8 * MASS, 0.8 * VISCOUS, 0.8 * COULOMB, -0.05 * np.ones(2)])
UPPER = np.stack([1.2 * MASS, 1.2 * VISCOUS, 1.2 * COULOMB, 0.05 * np.ones(2)])


def robust(accuracy):
    extra = {} if accuracy is None else {"robust_accuracy": accuracy, "unmodelled_limit": 0.5}
    return IntegratedAdaptiveRobust(
        model=MODEL, error_decay=(30.0, 30.0), feedback_gain=(5.0, 5.0),
        frame=GlobalTaskFrame(rate_from="velocity"), parameter_lower=LOWER, parameter_upper=UPPER,
        initial_parameters=UPPER, compensation_rate=1e-6, compensation_limit=0.1,
        least_squares=FilteredLeastSquares(initial_covariance=(1e-6,) * 4), **extra,
    )  # fmt: skip


def test_the_energy_stays_below_its_bound():
    """Theorem 1: wrong parameters and a disturbance of known size; a constant gain breaks it."""
    eta, period, n = 0.01, 5e-5, 8000
    bound_rate = 2.0 * 5.0 / MASS.max()
    time = np.arange(n) * period

    def push(t):
        return 0.5 * jnp.stack([jnp.cos(9 * t), jnp.sin(9 * t)])

    results = {}
    for accuracy in (eta, None):
        energy, _, _, status, _ = closed_loop(
            robust(accuracy), machine(), push, (2e-4, -1e-4), n, period
        )
        assert np.all(status != 1)
        if accuracy is not None:
            assert np.all(status == 0)  # the gain was never held by the sampling
        decay = np.exp(-bound_rate * time)
        results[accuracy] = energy / (decay * energy[0] + eta / bound_rate * (1.0 - decay))
    assert results[eta].max() <= 1.0 + 1e-6
    assert results[None].max() > 1.5


def test_errors_and_parameters_converge_where_only_parameters_are_wrong():
    """Theorem 2: with excitation, s → 0 and θ̂ → θ."""
    law = IntegratedAdaptiveRobust(
        model=MODEL, error_decay=(30.0, 60.0), feedback_gain=(30.0, 60.0),
        parameter_lower=0.3 * LOWER, parameter_upper=2.0 * UPPER, initial_parameters=1.4 * UPPER,
        frame=GlobalTaskFrame(form="implicit"), compensation_rate=1e-6, compensation_limit=0.1,
        least_squares=FilteredLeastSquares(
            initial_covariance=(1e3, 1e4, 1e3, 1e4), normalisation=0.0, cutoff_hz=150.0,
            settle_time=0.05,
        ),
    )  # fmt: skip
    n, period = 12000, 2e-4
    _, s, error, _, estimate = closed_loop(
        law, machine(), lambda t: jnp.zeros(2) * t, (0.0, 0.0), n, period, rate=6.0
    )
    truth = np.stack([MASS, VISCOUS, COULOMB, np.zeros(2)])
    assert_allclose(estimate[-1], truth, atol=4e-3)
    assert np.abs(estimate[300] - truth).max() > 0.05  # it did have to learn
    early, late = slice(0, 300), slice(-3000, None)

    def rms(x):
        return np.sqrt(np.mean(x**2))

    assert rms(s[late]) < 0.1 * rms(s[early])
    assert rms(error[late, 1]) < 0.05 * rms(error[early, 1])


@pytest.mark.parametrize("frame", [GlobalTaskFrame, LocalTaskFrame])
def test_a_rotated_velocity_leaves_a_bias_and_the_coordinate_does_not(frame):
    """r_c = -T κ v² / (2 Λ) on a circle, in both frames."""
    radius, speed, period, decay = 0.05, 0.3, 1e-3, 60.0
    contour = Circle(radius=radius)
    reference = cl.feedrate.constant_feed(contour, feed=speed, sample_time=period, duration=2.0)
    predicted = -period * speed**2 / radius / (2.0 * decay)
    found = {}
    for kind in ("velocity", "coordinates"):
        law = IntegratedAdaptiveRobust(
            model=MODEL, error_decay=(30.0, decay), feedback_gain=(30.0, 60.0), uncertainty=0.01,
            disturbance_limit=1.0, frame=frame(rate_from=kind),
        )  # fmt: skip
        plant = machine(velocity="difference")
        run = cl.simulate(plant, law, reference)
        found[kind] = float(np.mean(np.asarray(run["contour_error"])[1200:]))
    # what else the sampling leaves is the same in both
    assert_allclose(found["velocity"] - found["coordinates"], predicted, rtol=0.02)
    assert abs(found["coordinates"]) < 0.1 * abs(predicted)


def test_the_global_frame_is_better_where_the_tool_lags():
    """Soft along the path: the local frame takes κ e_t²/2 for no error, the global one sees it."""
    errors = {}
    reference = cl.feedrate.constant_rate(ELLIPSE, rate=4.0, duration=2.5, sample_time=1e-3)
    short = cl.replace(MODEL, mass=0.7 * MASS, viscous=0.7 * VISCOUS)
    for frame in (GlobalTaskFrame(), LocalTaskFrame()):
        law = DirectAdaptiveRobust(
            model=short, error_decay=(8.0, 80.0), feedback_gain=(1.0, 30.0), uncertainty=0.0,
            disturbance_limit=1e-9, frame=frame, adaptation_rate=(1e-9,) * 4,
        )  # fmt: skip
        run = cl.simulate(machine(), law, reference)
        errors[type(frame)] = run.metrics_between(0.8, 2.5)["contour_error_rms"]
    assert errors[GlobalTaskFrame] < 0.75 * errors[LocalTaskFrame]


def test_direct_adaptation_drifts_with_the_noise_of_the_velocity():
    """M̂_i' = Γ σ² (Λ_t t_i² + Λ_n n_i²): on a line, with counts of an encoder as noise."""
    rng = np.random.default_rng(4)
    law = DirectAdaptiveRobust(
        model=MODEL, error_decay=(30.0, 90.0), feedback_gain=(10.0, 10.0), uncertainty=0.9,
        disturbance_limit=1.0, adaptation_rate=(10.0, 1e-9, 1e-9, 1e-9),
        frame=LocalTaskFrame(rate_from="velocity"),
    )  # fmt: skip
    contour, n, sigma = cl.contours.Line(start=(0.0, 0.0), end=(0.4, 0.3)), 4000, 2e-3
    samples = make_samples(contour, n, 1e-3, NEEDS, error=np.zeros(2))
    noise = sigma * rng.normal(size=(n, 2))

    @jax.jit
    def run(law, samples, noise):
        def step(state, row):
            sample, v = row
            sample = cl.recordings.Sample(
                sample.time, sample.reference, sample.geometry, sample.preview, sample.position,
                sample.velocity + v,
            )  # fmt: skip
            return law.step(state, sample)[1], None

        first = jax.tree.map(lambda x: x[0], samples)
        return jax.lax.scan(step, law.init(first), (samples, noise))[0].adaptation

    bound = law.bind(contour, 1e-3)
    moved = np.asarray(run(bound, jax.tree.map(jnp.asarray, samples), noise)) - bound.initial
    t, across = np.array([0.8, 0.6]), np.array([0.6, -0.8])
    predicted = 10.0 * sigma**2 * (30.0 * t**2 + 90.0 * across**2) * n * 1e-3
    assert_allclose(moved[0], predicted, rtol=0.1)  # 1/sqrt(n) of a squared normal is 2 %
