"""The closed form of a motion run at another pace, against quadrature and an ODE solver."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import BSpline

from contourlab.feedrate.retiming import Retiming, spline_basis, spline_values

CASES = {
    "growing": [1.0, 1.5, 2.5, 4.0, 6.0],
    "falling": [4.0, 3.0, 2.5, 1.0, 0.2],
    "wavy": [1.0, 3.0, 0.3, 2.0, 0.5],
    "steady": [2.0, 2.0, 2.0, 2.0],
    "nearly steady": [2.0, 2.0 + 1e-9, 2.0, 2.0 - 1e-9],
    "linear": [1.0, 2.0, 3.0, 4.0],
    "from almost nothing": [1e-6, 1e-6, 1.0, 4.0],
}


def knots_of(coefficient, even):
    n = len(coefficient) - 2
    return 0.3 * np.arange(n + 1) if even else np.cumsum([0.0, 0.3, 0.05, 0.4][: n + 1])


def squared_pace(u, knots, coefficient):
    """By scipy: the knots beyond both ends mirror the first and the last interval."""
    first, last = knots[1] - knots[0], knots[-1] - knots[-2]
    beyond = np.concatenate(
        [knots[0] - first * np.arange(2, 0, -1), knots, knots[-1] + last * np.arange(1, 3)]
    )
    spline = BSpline(beyond, coefficient, 2)
    return np.array([float(spline(u, nu=k)) for k in range(3)])


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("name", CASES)
def test_basis_is_that_of_b_splines(name, even):
    coefficient = np.array(CASES[name])
    knots = knots_of(coefficient, even)
    for interval in range(len(knots) - 1):
        for place in (0.01, 0.4, 0.99):
            i, s = np.array([interval]), np.array([place])
            u = knots[interval] + place * (knots[interval + 1] - knots[interval])
            values = spline_values(spline_basis(knots, i, s), i, coefficient)[:, 0]
            assert_allclose(values, squared_pace(u, knots, coefficient), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("name", CASES)
def test_durations_are_the_integral_of_one_over_the_pace(name, even):
    coefficient = np.array(CASES[name])
    knots = knots_of(coefficient, even)
    pace = Retiming.of_spline(knots, coefficient, 0.0)
    for k, took in enumerate(pace.duration):
        exact, _ = quad(
            lambda u: squared_pace(u, knots, coefficient)[0] ** -0.5, knots[k], knots[k + 1],
            epsabs=1e-13, epsrel=1e-12, limit=200,
        )  # fmt: skip
        assert_allclose(took, exact, rtol=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_own_time_solves_its_equation(name):
    coefficient = np.array(CASES[name])
    knots = knots_of(coefficient, False)
    pace = Retiming.of_spline(2.0 + knots, coefficient, 5.0)
    end = pace.time[-1] + pace.duration[-1]
    time = np.linspace(5.0, end, 40)
    u, c, d, e = pace.at(time)
    solved = solve_ivp(
        lambda t, y: [squared_pace(min(y[0], knots[-1]), knots, coefficient)[0] ** 0.5],
        (5.0, end), [0.0], t_eval=time, rtol=1e-11, atol=1e-13, max_step=0.02,
    )  # fmt: skip
    assert_allclose(u - 2.0, solved.y[0], atol=1e-8)
    inside = (time > 5.0) & (time < end)
    wanted = np.array([squared_pace(x, knots, coefficient) for x in (u - 2.0)[inside]]).T
    assert_allclose(c[inside], wanted[0], rtol=1e-9)
    assert_allclose(d[inside], wanted[1], rtol=1e-6, atol=1e-7)
    assert_allclose(u[[0, -1]], [2.0, 2.0 + knots[-1]], rtol=1e-14)
    assert e.shape == time.shape


def test_joined_rows_keep_their_order():
    knots = np.array([0.0, 0.1, 0.2])
    first = Retiming.of_spline(knots, np.ones(4), 0.0)
    second = Retiming.of_spline(10.0 + knots, np.full(4, 4.0), 1.0)
    joined = Retiming.join([first, second])
    u = joined.at(np.array([0.05, 0.2, 1.0, 1.05, 1.1]))[0]
    assert_allclose(u, [0.05, 0.2, 10.0, 10.1, 10.2])
