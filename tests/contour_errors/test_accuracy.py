"""The accuracy study against closed forms, an independent prototype's table, and wrong input."""

import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq
from scipy.special import ellipeinc

import contourlab as cl
from contourlab.contour_errors import (
    Estimator,
    EstimatorNeeds,
    ExtendedNaturalLocalEstimator,
    NaturalLocalEstimator,
    NewtonEstimator,
    OsculatingCircleEstimator,
    TangentEstimator,
    study_contours,
    study_estimators,
)
from contourlab.contour_errors.accuracy_run import run_estimator
from contourlab.contour_errors.accuracy_samples import Motion, lagging_motion, places, stream
from contourlab.contours import Circle, Contour, Ellipse, FigureEight, Line, foot_point
from contourlab.errors import ConfigurationError, FeedError, RefusedError, UnitError
from contourlab.feedrate.arc_length import ArcLength
from contourlab.recordings.reference import ReferencePoint

LINE = Line(start=(0.0, 0.0), end=(0.05, 0.0))
ROUNDING = 1e-15
"""[m]: some units of rounding of coordinates of 0.05 m."""


def study(contours, estimators, **options):
    return cl.estimate_accuracy(contours, estimators, **{"cost": False, "points": 50, **options})


def test_tangent_on_a_circle_is_as_by_hand():
    radius, lag, offset = 0.03, 2e-3, 1e-4
    found = study(
        Circle(radius=radius), ["tangent", "osculating-circle"], lag=lag, offset=[offset, -offset]
    )
    turn = lag / radius
    for row in found.rows[:2]:  # a positive offset is to the left: inside the circle
        actual = radius - row.offset
        estimate = radius - actual * np.cos(turn)  # along the normal at the reference
        assert_allclose(row.error_max, abs(abs(estimate) - offset), atol=ROUNDING)
        assert_allclose(row.error_mean, row.error_max, atol=ROUNDING)
        difference = np.hypot(estimate - row.offset * np.cos(turn), row.offset * np.sin(turn))
        assert_allclose(row.vector_error_max, difference, atol=ROUNDING)
        assert row.n_points == 50
    for row in found.rows[2:]:
        assert row.vector_error_max < 10 * ROUNDING


def test_tangent_on_an_ellipse_is_as_by_elliptic_integrals():
    a, b, lag, offset, points = 0.03, 0.01, 1e-3, 1e-5, 20
    row = study(Ellipse(semi_axes=(a, b)), "tangent", lag=lag, offset=offset, points=points).rows[0]

    def arc(angle):  # from the end of the long axis
        shape = 1.0 - (b / a) ** 2
        return a * (ellipeinc(angle - np.pi / 2, shape) - ellipeinc(-np.pi / 2, shape))

    def angle_at(length):
        return brentq(lambda t: arc(t) - length, -1.0, 7.0, xtol=1e-15)

    errors = []
    for k in range(points):
        s = k * arc(2 * np.pi) / points
        t, u = angle_at(s), angle_at(s - lag)
        tangent = np.array([-a * np.sin(t), b * np.cos(t)])
        behind = np.array([-a * np.sin(u), b * np.cos(u)])
        left = np.array([-behind[1], behind[0]]) / np.linalg.norm(behind)
        actual = np.array([a * np.cos(u), b * np.sin(u)]) + offset * left
        away = np.array([a * np.cos(t), b * np.sin(t)]) - actual
        across = (tangent[0] * away[1] - tangent[1] * away[0]) / np.linalg.norm(tangent)
        errors.append(abs(abs(across) - offset))
    # the two arc lengths are inverted to 1e-15 relative, the tangent turns by 300 rad/m there
    assert_allclose([row.error_mean, row.error_max], [np.mean(errors), np.max(errors)], rtol=1e-9)


@pytest.mark.parametrize(
    ("contour", "outward", "lag", "table"),
    [
        # tangent, circle, natural local, extended: mean / largest in um
        (
            Ellipse(semi_axes=(0.03, 0.01)), -1.0, 1e-3,
            [25.91, 130.3, 2.377, 12.33, 2.332, 11.12, 0.243, 1.428],
        ),
        (
            Ellipse(semi_axes=(0.03, 0.01)), -1.0, 2e-3,
            [121.7, 579.5, 16.54, 111.8, 15.49, 87.42, 1.897, 9.774],
        ),
        (
            FigureEight(half_sizes=(0.03, 0.03)), 1.0, 1e-3,
            [26.15, 139.4, 2.133, 11.48, 2.130, 10.22, 0.237, 1.457],
        ),
    ],
    ids=["ellipse 1 mm", "ellipse 2 mm", "figure of eight 1 mm"],
)  # fmt: skip
def test_estimators_agree_with_an_independent_prototype(contour, outward, lag, table):
    """Its protocol is not the study's: places even in the parameter, and the lag lag / |r'| of it.

    So its means weigh the sharp bends more, and its lags are arc lengths to first order only.
    """
    at = 2 * np.pi * np.arange(200) / 200
    rows = np.asarray(jax.vmap(lambda p: contour.derivatives(p, 3))(at))
    behind = at - lag / np.linalg.norm(rows[:, 1], axis=1)
    frame = jax.vmap(contour.frenet)(behind)
    actual = np.asarray(jax.vmap(contour.position)(behind) + 1e-5 * outward * frame.normal)
    exact = np.abs(foot_point(contour, actual, at).distance)
    zero, still = np.zeros(200), np.zeros((200, 2))
    reference = ReferencePoint(at, zero, zero, rows[:, 0], still, still, still)
    motion = Motion(reference, rows, zero, actual[None], still[None])
    found = []
    for estimator in (
        TangentEstimator(), OsculatingCircleEstimator(), NaturalLocalEstimator(),
        ExtendedNaturalLocalEstimator(),
    ):  # fmt: skip
        estimates = run_estimator(estimator, motion, np.zeros(1), state=False)[0, 0]
        error = np.abs(np.linalg.norm(estimates, axis=1) - exact)
        found += [1e6 * error.mean(), 1e6 * error.max()]
    assert_allclose(found, table, rtol=2.5e-3)  # half a unit of its last digit: 0.237


def test_a_filtered_newton_estimate_misses_by_feed_over_rate():
    # a loop of type 1 stays V / k' behind on a line, whatever the lag; k' = 500 /s
    found = study(
        LINE, {"paper": NewtonEstimator(form="filtered")}, lag="1 mm", offset="10 um",
        feed="3000 mm/min, 6000 mm/min", points=20,
    )  # fmt: skip
    for row, miss in zip(found.rows, (1e-4, 2e-4), strict=True):
        # the slowest mode is exp(-250 t): 1e-11 is left of the start after 0.1 s
        assert_allclose([row.vector_error_mean, row.vector_error_max], miss, rtol=1e-8)
        assert_allclose(row.error_max, np.hypot(miss, 1e-5) - 1e-5, rtol=1e-8)
    at_once = study(
        LINE, {"paper": NewtonEstimator(form="filtered")}, lag="1 mm", start_up=0.0, points=20
    )
    assert at_once.rows[0].vector_error_max > 5e-4  # it starts at the reference: the lag itself


def test_encoders_are_rounded_and_the_truth_is_not():
    found = study(LINE, "tangent", lag=0.0, offset=3.7e-6, resolution=[0.0, 1e-6, 10e-6])
    error = [row.error_max for row in found.rows]
    assert_allclose(error, [0.0, 0.3e-6, 3.7e-6], atol=ROUNDING)
    assert [row.resolution for row in found.rows] == [0.0, 1e-6, 1e-5]


def test_the_exact_error_is_the_offset():
    for contour in (study_contours()[name] for name in ("ellipse", "helix")):
        table = ArcLength(contour)
        motion = lagging_motion(table, places(table, 1e-3, 9).arc, 1e-3, np.array([2e-4, -2e-4]),
                                0.05, 1e-3, 2)  # fmt: skip
        foot = foot_point(contour, motion.position[0], motion.reference.parameter)
        exact = 2e-4 * (np.sqrt(2.0) if contour.n_axes == 3 else 1.0)
        assert_allclose(np.linalg.norm(foot.vector, axis=1), exact, atol=1e-14)
        # velocities against differences of the positions over one sample of 2e-5 s
        track = np.array([0.02, 0.02 + 1e-6])
        ahead = lagging_motion(table, track, 1e-3, np.array([2e-4]), 0.05, 2e-5, 2)
        moved = (ahead.position[0, 1] - ahead.position[0, 0]) / 2e-5
        assert_allclose(ahead.velocity[0].mean(axis=0), moved, atol=1e-9)


def test_places_and_streams():
    line, circle = ArcLength(LINE), ArcLength(Circle(radius=0.01))
    assert_allclose(places(line, 0.01, 5).arc, [0.01, 0.02, 0.03, 0.04, 0.05])
    assert_allclose(places(circle, 0.01, 4).arc, 0.005 * np.pi * np.arange(4))
    track = stream(line, 0.01, 4, 0.002, 5)
    assert_allclose(track.arc, 0.01 + 0.002 * np.arange(21))
    assert track.judged.tolist() == [5, 10, 15, 20]
    lap = stream(circle, 0.01, 4, 0.002, 5)
    assert_allclose(lap.arc, 0.002 * np.arange(-5, 32))  # 0.0628 m, from 5 samples before it
    assert lap.judged.tolist() == [5, 13, 21, 29]  # the nearest to 0, 0.0157, 0.0314, 0.0471
    assert stream(line, 0.01, 4, 0.002, 21) is None
    behind = lagging_motion(line, np.array([0.02]), 0.005, np.array([1e-3]), 0.05, 1e-3, 1)
    assert_allclose(behind.position[0, 0], [0.015, 1e-3], atol=ROUNDING)


def test_a_contour_that_is_refused_is_a_row_with_the_reason():
    found = study(["line", "helix"], ["variable_gain", "tangent"], lag=1e-4, points=2)
    refused = found.rows[2]
    assert (refused.contour, refused.estimator) == ("helix", "variable_gain")
    assert refused.error_mean is None
    assert refused.vector_error_max is None
    assert "2 coordinates, this one has 3" in refused.note
    assert [row.note for row in found.rows if row is not refused] == ["", "", ""]
    table = found.to_pandas()
    assert np.isnan(table.error_mean[2])
    assert table.error_max.dtype == float
    with pytest.raises(RefusedError, match=r"nothing can be judged: variable_gain on helix.*All"):
        study("helix", "variable-gain", lag=1e-4)


def test_what_cannot_be_followed_is_said():
    found = study(LINE, ["tangent", "foot_point"], lag=[1e-3, 0.06], feed=[0.05, 1.0, 1e-6])
    notes = {(r.estimator, r.lag, r.feed): r.note for r in found.rows}
    assert notes["tangent", 1e-3, 1e-6] == ""
    assert "no less than the contour's length" in notes["tangent", 0.06, 0.05]
    assert "end before start_up" in notes["foot_point", 1e-3, 1.0]
    assert "samples" in notes["foot_point", 1e-3, 1e-6]


class Lost(Estimator):
    """Not a number at every other place."""

    @property
    def needs(self):
        return EstimatorNeeds(derivatives=0)

    def estimate(self, sample):
        return jnp.where(sample.position[0] < 0.0235, jnp.nan, sample.geometry[0] - sample.position)


def test_estimates_that_are_no_numbers_are_counted():
    found = study(LINE, ["tangent", Lost()], lag=1e-3, points=50)
    assert found.rows[1].estimator == "lost"
    assert found.rows[1].note == "24 of 50 estimates are not finite"
    assert found.rows[1].error_max is None


def test_costs_are_of_the_condition():
    row = cl.estimate_accuracy(LINE, "tangent", lag=1e-3, points=5).rows[0]
    assert 0.1 < row.cost_ns < 1e6  # of the order of ten, whatever the machine is doing


def test_every_name_has_its_class():
    from contourlab import contour_errors, contours

    made = {type(value) for value in study_contours().values()}
    for name in contours.__all__:
        value = getattr(contours, name)
        if inspect.isclass(value) and issubclass(value, Contour) and not inspect.isabstract(value):
            # without a size of their own: a path, and what is made of points or another contour
            fixed = value.__module__.rsplit(".", 1)[-1] in FORMULAS
            assert (value in made) == fixed, name
    known = {type(value) for value in study_estimators().values()}
    for name in contour_errors.__all__:
        value = getattr(contour_errors, name)
        if inspect.isclass(value) and issubclass(value, Estimator) and value is not Estimator:
            assert value in known, name


FORMULAS = {
    "circle", "ellipse", "figure_eight", "heart", "helix", "line", "lissajous", "parabola",
    "sinusoid", "spiral", "star",
}  # fmt: skip


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"lag": "1"}, UnitError, "the unit is missing.*length"),
        ({"lag": "1 mm/s"}, UnitError, "lag = '1 mm/s'.*not one of length"),
        ({"lag": -1e-3}, ConfigurationError, r"lag must be >= 0 m and finite, got -0.001"),
        ({"lag": "nan mm"}, UnitError, "lag must be a length"),
        ({"lag": np.nan}, ConfigurationError, "lag must be >= 0 m and finite, got nan"),
        ({"lag": []}, ConfigurationError, "lag must be a length or several, got none"),
        ({"lag": [[1e-3]]}, UnitError, "lag must be a length"),
        ({"offset": np.inf}, ConfigurationError, "offset must be finite, got inf"),
        ({"feed": 0.0}, ConfigurationError, "feed must be > 0 m/s and finite"),
        ({"feed": True}, UnitError, "feed must be a velocity"),
        ({"resolution": -1e-6}, ConfigurationError, "resolution must be >= 0 m"),
        ({"sample_time": 0.0}, ConfigurationError, "sample_time must be > 0 s"),
        ({"start_up": -1.0}, ConfigurationError, "start_up must be >= 0 s"),
        ({"points": 0}, ConfigurationError, "points must be a whole number from 2 to"),
        ({"contours": "elipse"}, ConfigurationError, "contour 'elipse'; did you mean ellipse"),
        ({"contours": []}, ConfigurationError, "no contour is given; Allowed: arc, circle"),
        ({"contours": 3}, ConfigurationError, "contour 'int' must be of class Contour, got 3"),
        ({"contours": ["line", LINE]}, ConfigurationError, "contour 'line' is given twice"),
        ({"estimators": "tangents"}, ConfigurationError, "did you mean tangent"),
        ({"estimators": TangentEstimator}, ConfigurationError, "must be of class Estimator"),
        ({"contours": {"a": Line(start=(0, 0, 0, 0), end=(1, 1, 1, 1))}}, RefusedError,
         "an offset needs a contour of 2 or 3 coordinates, this one has 4"),
    ],
)  # fmt: skip
def test_wrong_input_is_named(options, error, message):
    with pytest.raises(error, match=message):
        study(**{"contours": "line", "estimators": "tangent", "lag": 1e-3, **options})


def test_a_contour_that_stands_still_has_no_lag():
    class Cusp(Contour):
        n_axes = property(lambda self: 3)
        domain = property(lambda self: (-1.0, 1.0))
        closed = property(lambda self: False)

        def position(self, parameter, piece=None):
            return jnp.stack([parameter**2, parameter**3, parameter**4])

    with pytest.raises(FeedError, match="cusp"):
        study({"cusp": Cusp()}, "tangent", lag=1e-3)


def test_near_a_crossing_the_judge_keeps_to_the_branch_of_the_reference():
    """Where the figure of eight crosses itself the other branch is nearer than 2 mm."""
    eight = FigureEight(half_sizes=(0.03, 0.03))
    found = study({"eight": eight}, "newton", lag=1e-3, offset=2e-3, points=60, cost=False)
    points = np.asarray(jax.vmap(eight.position)(jnp.linspace(0.0, 2.0 * jnp.pi, 60)))
    assert np.sum(np.linalg.norm(points, axis=1) < 2e-3) >= 2  # some of it is there
    assert found.rows[0].error_max < 1e-12
    assert found.rows[0].vector_error_max < 1e-12
