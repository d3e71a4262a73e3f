"""The closed form of a motion run at another pace, against quadrature and an ODE solver."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad, solve_ivp

from contourlab.feedrate.retiming import Retiming, spline_values

CASES = {
    "growing": [1.0, 1.5, 2.5, 4.0, 6.0],
    "falling": [4.0, 3.0, 2.5, 1.0, 0.2],
    "wavy": [1.0, 3.0, 0.3, 2.0, 0.5],
    "steady": [2.0, 2.0, 2.0, 2.0],
    "nearly steady": [2.0, 2.0 + 1e-9, 2.0, 2.0 - 1e-9],
    "linear": [1.0, 2.0, 3.0, 4.0],
    "from almost nothing": [1e-6, 1e-6, 1.0, 4.0],
}


def squared_pace(u, h, coefficient):
    i = min(int(u / h), len(coefficient) - 3)
    one = np.ones(1)
    return spline_values(np.array([i]), one * (u / h - i), one * h, np.array(coefficient))[:, 0]


@pytest.mark.parametrize("name", CASES)
def test_durations_are_the_integral_of_one_over_the_pace(name):
    coefficient, h = np.array(CASES[name]), 0.3
    pace = Retiming.of_spline(0.0, h, coefficient, 0.0)
    for k, took in enumerate(pace.duration):
        exact, _ = quad(
            lambda u: squared_pace(u, h, coefficient)[0] ** -0.5, k * h, (k + 1) * h,
            epsabs=1e-13, epsrel=1e-12, limit=200,
        )  # fmt: skip
        assert_allclose(took, exact, rtol=1e-10)


@pytest.mark.parametrize("name", CASES)
def test_own_time_solves_its_equation(name):
    coefficient, h = np.array(CASES[name]), 0.3
    pace = Retiming.of_spline(2.0, h, coefficient, 5.0)
    end = pace.time[-1] + pace.duration[-1]
    time = np.linspace(5.0, end, 40)
    u, c, d, e = pace.at(time)
    solved = solve_ivp(
        lambda t, y: [squared_pace(min(y[0], h * len(pace.time)), h, coefficient)[0] ** 0.5],
        (5.0, end), [0.0], t_eval=time, rtol=1e-11, atol=1e-13, max_step=0.01,
    )  # fmt: skip
    assert_allclose(u - 2.0, solved.y[0], atol=1e-8)
    inside = (time > 5.0) & (time < end)
    wanted = np.array([squared_pace(x, h, coefficient) for x in (u - 2.0)[inside]]).T
    assert_allclose(c[inside], wanted[0], rtol=1e-9)
    assert_allclose(d[inside], wanted[1], rtol=1e-6, atol=1e-8)
    assert_allclose(u[[0, -1]], [2.0, 2.0 + h * len(pace.time)], rtol=1e-14)
    assert e.shape == time.shape


def test_joined_rows_keep_their_order():
    first = Retiming.of_spline(0.0, 0.1, np.ones(4), 0.0)
    second = Retiming.of_spline(10.0, 0.1, np.full(4, 4.0), 1.0)
    joined = Retiming.join([first, second])
    u = joined.at(np.array([0.05, 0.2, 1.0, 1.05, 1.1]))[0]
    assert_allclose(u, [0.05, 0.2, 10.0, 10.1, 10.2])
