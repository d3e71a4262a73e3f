"""The recurrence that a reference obeys, and the immersion that follows it."""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.controllers.exosystem import alpha_1, alpha_2, transition, turning
from contourlab.controllers.immersion import (
    InternalUnit,
    solve_closed_form,
    solve_general,
    unit_2,
    unit_2_as_printed,
)
from contourlab.controllers.pulse_model import PulseModel
from contourlab.machines.published.cao_zhang import cao_zhang_pulse_model

T = 1e-3
NUMERATOR, DENOMINATOR = cao_zhang_pulse_model(4)


def signals(n=400, offset=10.0, step=T):
    """Figure 5: the master at t + 0.1 sin 5t, f = sin of it."""
    t = step * np.arange(n) + 0.3
    s = t + 0.1 * np.sin(5.0 * t)
    return np.sin(s), s + offset


def coefficients(f, g):
    """α1(k), α2(k) for k = 1 ... n - 3, in columns; row k - 1."""
    first = [np.asarray(alpha_1(f[k - 1 : k + 2, None], g[k - 1 : k + 2, None])[0])
             for k in range(1, len(f) - 2)]  # fmt: skip
    second = [np.asarray(alpha_2(f[k : k + 3, None], g[k : k + 3, None]))
              for k in range(1, len(f) - 2)]  # fmt: skip
    return np.hstack([first, second])


def test_both_signals_obey_the_recurrence_to_rounding():
    f, g = signals(60)
    alpha = coefficients(f, g)
    for x in (f, g):
        left = x[3:-1] + alpha[1:, 0] * x[2:-2] + alpha[:-1, 1] * x[1:-3]
        assert np.max(np.abs(left)) <= 4 * np.finfo(float).eps * np.max(np.hypot(f, g))


def test_a_circle_in_sine_and_cosine_has_constant_coefficients():
    angle = 0.01 * np.arange(20)
    alpha = coefficients(np.sin(angle), np.cos(angle))
    assert_allclose(alpha, np.tile([-2.0 * np.cos(0.01), 1.0], (17, 1)), atol=1e-12)


def test_the_transition_is_exact_whatever_the_step():
    """S̄ of (20) carries w over, and is the exponential of the integral of (18)."""
    f, g = signals(3, step=0.4)
    w = np.stack([f, g])
    assert_allclose(transition(f[:2], g[:2]) @ w[:, 0], w[:, 1], rtol=1e-14)
    # Gauss-Legendre of (18) over the step, then the exponential of the commuting matrix
    nodes, weights = np.polynomial.legendre.leggauss(40)
    t = 0.3 + 0.2 * (nodes + 1.0)
    s, rate = t + 0.1 * np.sin(5 * t), 1.0 + 0.5 * np.cos(5 * t)
    x, y, slope = np.sin(s), s + 10.0, np.cos(s)
    squared = x**2 + y**2
    growth = 0.2 * np.sum(weights * rate * (x * slope + y) / squared)
    turn = 0.2 * np.sum(weights * rate * (x - slope * y) / squared)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    assert_allclose(transition(f[:2], g[:2]), np.exp(growth) * rotation, rtol=1e-12)


def test_a_negative_position_is_no_other_recurrence():
    """(15) as printed, an arccosine, would give this another sign of turning."""
    f, g = signals(20, offset=-10.0)
    alpha = coefficients(f, g)
    left = f[3:-1] + alpha[1:, 0] * f[2:-2] + alpha[:-1, 1] * f[1:-3]
    assert np.max(np.abs(left)) < 1e-14


@pytest.mark.parametrize(
    ("f", "holds"),
    [((0.0, 0.0, 0.0), True), ((0.7, 0.7, 0.7), True), ((1.0, 2.0, 3.0), True),
     ((1.0, 2.0, 4.0), False)],
    ids=["of nothing", "at rest", "on a line", "on a curve"],
)  # fmt: skip
def test_where_it_stands_a_straight_line_stands_in_and_is_one_or_not(f, holds):
    """g like f does not turn; that of a slave at rest is a recurrence all the same."""
    values = jnp.asarray(f)[:, None]
    alpha, well = alpha_1(values, values)
    assert float(alpha[0]) == -2.0
    assert bool(well[0]) == holds
    assert float(alpha_2(values, values)[0]) == 1.0


def test_where_the_exosystem_turns():
    """tan s = s at 4.4934: singular with the position, never with the slope."""
    s = np.linspace(4.0, 5.0, 101)[:, None]
    one = np.ones_like(s)
    assert turning(np.sin(s), np.cos(s), s, one)[0] == 0.0
    assert turning(np.sin(s), np.cos(s), np.cos(s), -np.sin(s))[0] > 0.9
    early = np.linspace(1.0, 4.0, 101)[:, None]
    assert turning(np.sin(early), np.cos(early), early, np.ones_like(early))[0] > 0.0


@pytest.mark.parametrize("axis", range(4))
def test_the_general_and_the_closed_form_agree(axis):
    """On random coefficients: 3 x 3 by elimination against (C)."""
    rng = np.random.default_rng(axis)
    for before, now in rng.normal([-2.0, 1.0], 0.3, (20, 2, 2)):
        q, p = solve_general(DENOMINATOR[axis], NUMERATOR[axis], before, now)
        closed_q, closed_p = solve_closed_form(DENOMINATOR[axis], NUMERATOR[axis], before, now)
        assert_allclose(closed_q, q, rtol=1e-9)
        assert_allclose(closed_p, p, rtol=1e-9)


def follow(unit, f, alpha, start):
    """Return what the axis and unit 2 make of themselves, y(k), from a given start."""
    a, b = DENOMINATOR[1], NUMERATOR[1]
    x, xi, out = np.array(start[:2]), start[2], []
    for k in range(1, len(alpha) - 1):
        one = unit(a, b, alpha[k - 1], alpha[k], alpha[k + 1])
        y = x[0]
        out.append(y)
        u = one.gamma * xi - one.direct * y
        xi = one.phi * xi - one.psi * y
        x = np.array([-a[0] * y + x[1] + b[0] * u, -a[1] * y + b[1] * u])
    return np.array(out)


def residual(y, alpha):
    """How far y is from S y = 0; alpha[j] is of the instant j + 1, and y[0] of the instant 2."""
    later = alpha[2 : 2 + len(y) - 2, 0], alpha[1 : 1 + len(y) - 2, 1]
    return np.max(np.abs(y[2:] + later[0] * y[1:-1] + later[1] * y[:-2])) / np.max(np.abs(y))


def test_the_time_indices_are_right_and_the_literal_reading_fails():
    """With right indices the loop of axis and unit 2 obeys S y = 0 from any start; else not."""
    f, g = signals(300)
    alpha = coefficients(f, g)
    start = (1e-3, -0.9e-3, 0.5e-3)
    right = follow(lambda a, b, before, now, after: unit_2(a, b, before, now), f, alpha, start)
    literal = follow(
        lambda a, b, before, now, after: unit_2_as_printed(a, b, now, after), f, alpha, start
    )
    assert residual(right, alpha) < 1e-9
    assert residual(literal, alpha) > 1e4 * residual(right, alpha)


def test_without_division_it_is_the_same_input():
    """(D1), (D2) against unit 2 with q: the same u, given the same past."""
    f, g = signals(200)
    alpha = coefficients(f, g)
    a, b = DENOMINATOR[1], NUMERATOR[1]
    model = PulseModel(denominator=DENOMINATOR[1:2], numerator=NUMERATOR[1:2])
    delta, beta = alpha - a, b[1] / b[0]
    nu = delta[:, 1] / beta - delta[:, 0]
    xi, chi = 0.3, nu[0] * 0.3
    # the same u(1): η - δ1 u_r = β χ - δ1 u_r
    unit = InternalUnit(jnp.array([[beta * chi]]))
    for k in range(1, 150):
        u_r = f[k + 1]
        one = unit_2(a, b, alpha[k - 1], alpha[k])
        by_q = one.gamma * xi - one.direct * u_r
        by_memory = unit.output(model, jnp.asarray(delta[k, :1]), jnp.array([u_r]))
        assert_allclose(by_memory[0], by_q, rtol=1e-6)
        xi = one.phi * xi - one.psi * u_r
        unit = unit.advance(model, jnp.asarray(delta[k : k + 1]), jnp.array([u_r]), by_memory)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_the_immersion_follows_on_axes_of_every_order(order):
    """A(z) f = B(z) u with u by (D) from exact u_r = f, once the memory has settled."""
    rng = np.random.default_rng(order)
    poles, zeros = rng.uniform(0.2, 0.9, order), rng.uniform(-0.5, 0.5, order - 1)
    a, b = np.poly(poles)[1:], 2e-3 * np.poly(zeros)
    model = PulseModel(denominator=a[None], numerator=b[None])
    f, g = signals(300)
    alpha = coefficients(f, g)
    padded = np.zeros((len(alpha), order))
    padded[:, :2] = alpha
    unit, u = InternalUnit(jnp.zeros((1, order - 1))), []
    for k in range(len(alpha)):
        u_r = jnp.array([f[k + 1]])
        u.append(unit.output(model, jnp.asarray(padded[k, :1] - a[:1]), u_r))
        unit = unit.advance(model, jnp.asarray(padded[k : k + 1] - a), u_r, u[-1])
    u, y = np.array(u)[:, 0], f[1 : 1 + len(alpha)]
    left = np.convolve(np.r_[1.0, a], y)[order : len(y)]
    right = np.convolve(np.r_[0.0, b], u)[order : len(y)]
    assert_allclose(right[100:], left[100:], atol=1e-10 * np.max(np.abs(y)))
