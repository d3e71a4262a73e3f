"""Filtered least squares against batch least squares, closed forms and exact motions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.configuration import replace
from contourlab.controllers import FilteredLeastSquares
from contourlab.errors import ConfigurationError

T = 5e-4
TRUE = np.array([[0.12, 0.55], [0.35, 0.5], [0.1, 0.13], [0.05, -0.2]])
LOWER = np.array([[0.01, 0.01], [0.0, 0.0], [0.0, 0.0], [-1.0, -1.0]])
UPPER = np.array([[1.0, 1.0], [2.0, 2.0], [0.5, 0.5], [1.0, 1.0]])
START = np.array([[0.1, 0.5], [0.3, 0.3], [0.1, 0.15], [0.0, 0.0]])


@jax.jit
def learned(law, positions, commands, start):
    """States along a record; command k acted after position k."""

    def step(state, row):
        state = law.step(state, *row)
        return state, state

    before = jnp.concatenate([jnp.zeros_like(commands[:1]), commands[:-1]])
    return jax.lax.scan(step, law.init(positions[0], start), (positions, before))[1]


def motion(n, dry=True, viscous=True, excited=True):
    """Positions that constant accelerations over each sample make, and the commands for them.

    Without viscous and dry friction the command is constant over the sample too, and exact.
    """
    t = np.arange(n) * T
    a = np.stack(
        [3 * np.cos(9 * t) + 6 * np.sin(31 * t), -2 * np.sin(7 * t) + 5 * np.cos(23 * t)], 1
    )
    a = a if excited else np.zeros_like(a)
    v = np.concatenate([np.zeros((1, 2)), np.cumsum(a, 0) * T])[:-1]
    q = np.concatenate([np.zeros((1, 2)), np.cumsum(v * T + a * T**2 / 2, 0)])[:-1]
    middle = v + a * T / 2
    u = TRUE[0] * a - TRUE[3]
    u = u + viscous * TRUE[1] * middle
    u = u + dry * TRUE[2] * 2 / np.pi * np.arctan(9000 * middle)
    return q, u


def bound(**changes):
    fields = {"cutoff_hz": (250.0, 150.0), "initial_covariance": (10.0, 10.0, 10.0, 5000.0)}
    return FilteredLeastSquares(**(fields | changes)).bind(LOWER, UPPER, T)


def test_the_model_holds_after_the_filters():
    """y · θ = u_f to rounding of positions over T², for motions of constant acceleration."""
    q, u = motion(800)
    states = learned(bound(), q, u, TRUE)
    assert np.abs(np.asarray(states.residual)).max() < 1e-10
    assert_allclose(np.asarray(states.estimate)[-1], TRUE, rtol=1e-9)


def test_without_forgetting_it_is_batch_least_squares():
    law = bound(forgetting=0.0, normalisation=0.0)
    q, u = motion(400)
    u = u + np.random.default_rng(3).normal(scale=0.05, size=u.shape)
    states = learned(law, q, u, START)
    y, e = np.asarray(states.regressor), np.asarray(states.residual)
    before = np.concatenate([START[None], np.asarray(states.free)[:-1]])
    wanted = np.einsum("kpa,kpa->ka", y, before) - e
    for axis in range(2):
        rows, prior = y[:, :, axis], np.diag(1 / np.array([10.0, 10.0, 10.0, 5000.0]))
        information = prior + T * rows.T @ rows
        right = prior @ START[:, axis] + T * rows.T @ wanted[:, axis]
        assert_allclose(
            states.estimate[-1, :, axis], np.linalg.solve(information, right), rtol=1e-8
        )
        assert_allclose(states.covariance[-1, :, :, axis], np.linalg.inv(information), rtol=1e-6)


def test_forgetting_and_normalisation_follow_the_equations():
    """Against (3) integrated with a fine step by another rule: halving it halves the difference."""
    law = bound(forgetting=2.0, normalisation=0.1)
    q, u = motion(300)
    states = learned(law, q, u, START)
    y, e = np.asarray(states.regressor), np.asarray(states.residual)
    before = np.concatenate([START[None], np.asarray(states.free)[:-1]])
    wanted = np.einsum("kpa,kpa->ka", y, before) - e

    def euler(parts):
        h = T / parts
        theta, gamma = START.copy(), np.stack([np.diag([10.0, 10.0, 10.0, 5000.0])] * 2, 2)
        for k in range(len(y)):
            for _ in range(parts):
                g = np.einsum("ija,ja->ia", gamma, y[k])
                norm = 1 + 0.1 * np.sum(y[k] * g)
                zeta = np.sum(y[k] * theta, 0) - wanted[k]
                theta = theta - h * g * zeta / norm
                gamma = gamma + h * (2.0 * gamma - g[:, None] * g[None] / norm)
        return theta, gamma

    coarse, fine = (euler(parts) for parts in (4, 8))
    limit = [2 * f - c for c, f in zip(coarse, fine, strict=True)]
    # what stays is the N that is held over a sample, first order in T
    assert_allclose(states.free[-1], limit[0], atol=2e-3 * np.abs(TRUE - START).max())
    assert_allclose(states.covariance[-1], limit[1], atol=2e-2 * np.abs(limit[1]).max())


def test_it_converges_with_the_printed_settings_and_not_as_printed():
    q, u = motion(8000)
    quick = {"initial_covariance": (1e3, 1e3, 1e3, 5e3), "normalisation": 0.0}
    law = bound(**quick)
    assert_allclose(learned(law, q, u, START).estimate[-1], TRUE, atol=2e-3)
    frozen = bound(**quick, covariance_limit=500.0, at_limit="freeze")
    states = learned(frozen, q, u, START)
    assert_allclose(states.covariance[-1], states.covariance[0])  # (25) as printed never begins
    assert np.abs(states.estimate[-1] - TRUE).max() > 0.02
    held = learned(bound(**quick, covariance_limit=500.0), q, u, START)
    assert_allclose(held.estimate[-1], TRUE, atol=2e-3)


def test_the_norm_bounds_the_largest_eigenvalue_and_the_limit_holds():
    """Without excitation Γ grows to the limit and no further, and stays positive definite."""
    law = bound(forgetting=40.0, covariance_limit=8000.0)
    q, u = motion(2000, excited=False)
    states = learned(law, q, u, START)
    gamma = np.moveaxis(np.asarray(states.covariance), 3, 1)
    eigenvalues = np.linalg.eigvalsh(gamma)
    norm = np.asarray(jax.vmap(law.norm)(states.covariance))
    assert np.all(norm >= eigenvalues[..., -1] * (1 - 1e-12))
    assert np.all(norm <= 2 * eigenvalues[..., -1])
    assert norm.max() <= 8000.0 * np.exp(40.0 * T)
    assert norm[-1].min() > 5000.0  # it did grow
    assert eigenvalues.min() > 0.0


def test_estimates_stay_within_their_bounds():
    tight = np.array([[0.2, 0.6], [0.2, 0.2], [0.0, 0.0], [-0.1, -0.1]])
    law = FilteredLeastSquares(initial_covariance=(10.0, 10.0, 10.0, 5000.0)).bind(tight, UPPER, T)
    q, u = motion(4000)
    found = np.asarray(learned(law, q, u, START).estimate)
    assert np.all(found >= tight)
    assert np.all(found <= UPPER)
    assert_allclose(found[-1, 0], tight[0])  # the true mass is below
    # and what lies within is found as if there were no bounds
    wide = FilteredLeastSquares(initial_covariance=(10.0, 10.0, 10.0, 5000.0)).bind(LOWER, UPPER, T)
    assert_allclose(
        found[-1, 2], learned(wide, q, u, np.clip(START, tight, UPPER)).estimate[-1, 2], rtol=1e-6
    )


def test_a_held_command_does_not_bias_the_mass():
    """Exact motion of a held command: the bias is second order in T, not B T / (2 M)."""
    mass, viscous, n = 0.06, 50.0, 6000
    t = np.arange(n) * T
    u = np.stack([np.sin(40 * t) + 0.5 * np.sin(90 * t)] * 2, 1)
    decay = np.exp(-viscous * T / mass)
    q, v = np.zeros((n, 2)), np.zeros(2)
    for k in range(n - 1):
        end = u[k] / viscous
        q[k + 1] = q[k] + end * T + (v - end) * (1 - decay) * mass / viscous
        v = end + (v - end) * decay
    wide = 100.0 * UPPER
    law = FilteredLeastSquares(
        cutoff_hz=200.0,
        initial_covariance=(1e6, 1e9, 1.0, 1.0),
        forgetting=0.0,
        normalisation=0.0,
    ).bind(-wide, wide, T)
    start = np.array([[0.1] * 2, [30.0] * 2, [0.0] * 2, [0.0] * 2])
    found = np.asarray(learned(law, q, u, start).estimate)[-1]
    assert_allclose(found[1], viscous, rtol=5e-3)
    assert_allclose(found[0], mass, rtol=0.02)  # B T / (2 M) would be 21 %


def test_nothing_is_learned_while_it_settles():
    law = bound(settle_time=0.1)
    q, u = motion(400)
    states = learned(law, q, u, START)
    changed = np.any(np.asarray(states.estimate) != START, axis=(1, 2))
    assert np.argmax(changed) == 200
    assert_allclose(states.covariance[199], states.covariance[0])


def test_the_default_covariance_is_that_of_the_paper_in_size():
    lower = np.array([[0.06, 0.4], [0.2, 0.3], [0.05, 0.08], [-0.5, -0.5]])
    upper = np.array([[0.25, 0.7], [0.6, 0.6], [0.15, 0.25], [0.5, 0.5]])
    found = np.asarray(FilteredLeastSquares().bind(lower, upper, T).initial)
    assert_allclose(found[3], 1000.0)
    ratio = found / np.array([10.0, 10.0, 10.0, 5000.0])[:, None]
    assert np.all((ratio > 0.15) & (ratio < 20.0))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cutoff_hz": 600.0}, r"cutoff_hz must be <= 500 Hz, a quarter .* got 600"),
        ({"initial_covariance": (1.0, 2.0)}, r"initial_covariance must have shape \(4,\) or"),
        ({"forgetting": -1.0}, "forgetting must be >= 0"),
        ({"at_limit": "stop"}, "at_limit must be one of"),
    ],
)
def test_mistakes_are_named(changes, message):
    with pytest.raises(ConfigurationError, match=message):
        bound(**changes)


def test_bounds_are_checked():
    with pytest.raises(ConfigurationError, match=r"lower must be <= upper.* mass of axis 1"):
        FilteredLeastSquares().bind(replace_at(LOWER, 0, 1, 2.0), UPPER, T)
    with pytest.raises(ConfigurationError, match=r"upper must have shape \(4, 2\)"):
        FilteredLeastSquares().bind(LOWER, UPPER[:3], T)
    with pytest.raises(ConfigurationError, match="initial_covariance must be given"):
        FilteredLeastSquares().bind(LOWER, np.full_like(UPPER, np.inf), T)
    assert replace(FilteredLeastSquares(), forgetting=0.2).forgetting == 0.2


def replace_at(array, row, axis, value):
    array = array.copy()
    array[row, axis] = value
    return array


def test_a_long_rest_does_no_harm_without_a_limit_given():
    """e^(κ T n) overflows; by default Γ stays below its norm at the start, and so do θ̂ and θ̄."""
    n, forgetting = 20_000, 100.0
    law = bound(forgetting=forgetting)
    assert forgetting * T * n > 900.0
    rest = jnp.zeros((n, 2))
    states = learned(law, rest, rest, START)
    for leaf in jax.tree.leaves(states):
        assert np.all(np.isfinite(leaf))
    norm = np.asarray(jax.vmap(law.norm, in_axes=0)(states.covariance))
    start = np.sqrt(3 * 10.0**2 + 5000.0**2)
    assert_allclose(law.limit, start)
    assert norm.max() <= start * np.exp(forgetting * T) * (1 + 1e-12)
    assert norm[-1].min() > 0.9 * start  # it did grow back, up to there


def test_what_must_be_given():
    flat = np.array(UPPER)
    flat[3] = LOWER[3]
    with pytest.raises(ConfigurationError, match="initial_covariance must be given where"):
        FilteredLeastSquares().bind(LOWER, flat, T)
    with pytest.raises(ConfigurationError, match="covariance_limit must be given"):
        FilteredLeastSquares(at_limit="freeze").bind(LOWER, UPPER, T)
