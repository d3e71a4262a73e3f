"""From the master's position to the place on the path, and which axis can be the master."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours import (
    BSpline,
    Circle,
    Ellipse,
    Heart,
    Line,
    Lissajous,
    Path,
    Sinusoid,
    join,
)
from contourlab.controllers.master import choose_master, master_motion, why_not_master
from contourlab.controllers.position_domain import (
    PositionDomain,
    convert_as_printed,
    nearest_angle,
)
from contourlab.errors import RefusedError
from contourlab.machines.base import NominalModel

NAMES = ("axis 0", "axis 1")


def domain(path, conversion="tracked", axis=0, width=0.03):
    return PositionDomain(
        path=path, motion=master_motion("Law", path, axis, NAMES), turning_width=width,
        conversion=conversion,
    )  # fmt: skip


@jax.jit
def _along(where, positions, references):
    def step(state, row):
        state = where.step(state, *row)
        return state, state.parameter

    start = where.init(references[0])
    return jax.lax.scan(step, start, (positions, references))[1]


def located(where, positions, references):
    return np.asarray(_along(where, jnp.asarray(positions), jnp.asarray(references)))


T = 2e-3 * np.arange(6000)
MOTIONS = {
    "steady": T,
    "t + 0.5 sin t": T + 0.5 * np.sin(T),
    "decreasing": -T,
    "decreasing, unsteady": -(T + 0.5 * np.sin(T)),
    "from a turning point": T + np.pi,
    "from a rising branch": T + 4.5,
}


@pytest.mark.parametrize("name", MOTIONS)
def test_the_circle_is_converted_exactly_either_way_round(name):
    """Algorithm 3.1 put right: the angle of R cos θ with a lag of a tenth, started anywhere."""
    angle = MOTIONS[name]
    lag = 0.002 * np.gradient(angle, T)
    where = domain(Circle(radius=0.02), "arccos")
    found = located(where, 0.02 * np.cos(angle - lag), angle)
    # at a turning point arccos takes the root of the rounding; a start just before one is
    # ambiguous for the few samples until it is passed
    assert np.max(np.abs(found - (angle - lag))[10:]) < 3e-8


@pytest.mark.parametrize("name", ["steady", "decreasing", "t + 0.5 sin t"])
def test_tracking_finds_the_lag_and_keeps_it(name):
    """A steady lag exactly; one that changes, to its change within the turning width."""
    angle = MOTIONS[name]
    lag = 0.002 * np.gradient(angle, T)
    found = located(domain(Circle(radius=0.02)), 0.02 * np.cos(angle - lag), angle)
    error = np.abs(found - (angle - lag))[1500:]
    assert np.max(error) < (1e-4 if "sin" in name else 1e-9)


def test_tracking_stands_noise_that_the_arccosine_does_not():
    """Noise σ moves the place by σ / (ε R) at most; the arccosine by its root."""
    noise = 1e-8 * np.random.default_rng(1).normal(size=T.size)
    y = 0.02 * np.cos(T - 0.002) + noise
    tracked = located(domain(Circle(radius=0.02)), y, T)
    by_angle = located(domain(Circle(radius=0.02), "arccos"), y, T)
    errors = [np.max(np.abs(p - (T - 0.002))[1500:]) for p in (tracked, by_angle)]
    assert errors[0] < 5.0 * 1e-8 / (0.03 * 0.02)
    assert errors[1] > 5.0 * errors[0]


def test_algorithm_as_printed_makes_a_triangle_wave_monotone():
    """Figure 3: y falls from R to -R and back in straight lines."""
    y = 2.0 * np.abs(np.mod(0.35 * np.arange(400) / 10.0, 2.0) - 1.0) - 1.0
    angle = convert_as_printed(y, 1.0)
    assert np.all(np.diff(angle) > 0.0)
    assert_allclose(np.cos(angle), y, atol=1e-12)
    down = convert_as_printed(y, 1.0, decreasing=True)
    assert np.all(np.diff(down) < 0.0)


def test_the_printed_start_is_on_a_falling_branch():
    """y rises from 0, as zero initial conditions have it: it jumps to the next branch at once."""
    t = 1e-3 * np.arange(100)
    angle = convert_as_printed(np.sin(t), 1.0)
    assert angle[1] - angle[0] > 3.0
    assert_allclose(nearest_angle(np.sin(t[5]), 1.5 * np.pi), 1.5 * np.pi + t[5], atol=1e-12)


@pytest.mark.parametrize("branch", range(-4, 5))
def test_the_nearest_angle_is_lemma_3_1(branch):
    """(8) on [sπ, (s + 1)π], for every branch."""
    angle = branch * np.pi + np.linspace(0.02, np.pi - 0.02, 9)
    sign = (-1.0) ** branch
    printed = branch * np.pi + 0.5 * np.pi * (1 - sign) + sign * np.arccos(np.cos(angle))
    assert_allclose(printed, angle, atol=1e-12)
    found = [float(nearest_angle(np.cos(a), a + 0.015)) for a in angle]
    assert_allclose(found, angle, atol=1e-12)


def test_a_monotone_master_is_found_by_its_root():
    path = Sinusoid(amplitude=0.01, wavelength=0.02, periods=3.0)
    reference = np.linspace(0.0, 0.05, 200)
    late = np.maximum(reference - 0.003, 0.0)
    assert_allclose(located(domain(path), late, reference), late, atol=1e-15)
    # turned by 0.5 rad, with a slope that changes by a factor but not its sign
    turned = Sinusoid(amplitude=0.001, wavelength=0.02, periods=3.0).rotated(0.5)
    position = np.asarray(jax.vmap(turned.position)(jnp.asarray(late)))[:, 0]
    assert_allclose(located(domain(turned), position, reference), late, atol=1e-12)


def rectangle():
    corners = [(0.0, 0.0), (0.02, 0.0), (0.02, 0.01), (0.0, 0.01), (0.0, 0.0)]
    return join([Line(start=a, end=b) for a, b in itertools.pairwise(corners)]).path


def test_a_rectangle_makes_the_master_stand_still():
    for axis in (0, 1):
        assert "stands still" in why_not_master(rectangle(), axis)
    with pytest.raises(RefusedError, match=r"no axis.*axis 0 stands still at 20 mm from parameter"):
        choose_master("Law", rectangle(), model((1.0, 1.0)), NAMES)


def test_a_short_dwell_on_a_long_program_is_found():
    """A line of 0.1 mm across a program of 10 m: a grid of thousands would step over it."""
    corners = [(0.0, 0.0), (5.0, 1.0), (5.0, 1.0001), (10.0, 2.0)]
    assert "stands still at 5000 mm" in why_not_master(Path.polyline(corners), 0)
    assert why_not_master(Path.polyline(corners), 1) == ""
    at_the_end = [(0.0, 0.0), (5.0, 1.0), (10.0, 2.0), (10.0, 2.0001)]
    assert "stands still at 10000 mm" in why_not_master(Path.polyline(at_the_end), 0)


def test_a_dwell_and_a_turn_of_a_spline_are_found_in_their_spans():
    """A straight span across the master, and a wiggle, each a thousandth of the curve long."""
    knots = np.repeat([0.0, 1.0, 1.001, 2.0], [4, 3, 3, 4])
    across = [
        (0, 0),
        (1, 0),
        (2, 0),
        (3, 0),
        (3, 1e-3),
        (3, 2e-3),
        (3, 3e-3),
        (4, 0),
        (5, 0),
        (6, 0),
    ]
    spline = BSpline(control_points=1e-2 * np.array(across, float), degree=3, knots=knots)
    assert "stands still" in why_not_master(spline, 0)
    back = [(0, 0), (1, 0), (2, 0), (3, 0), (3.01, 0), (2.99, 0), (3, 1e-3), (4, 0), (5, 0), (6, 0)]
    wiggle = BSpline(control_points=1e-2 * np.array(back, float), degree=3, knots=knots)
    assert "turns back" in why_not_master(wiggle, 0)


def test_a_coordinate_that_turns_back_within_its_range_is_refused_with_where():
    path = Lissajous(amplitudes=np.array([0.01, 0.02]), frequencies=(1.0, 1.0),
                     phases=np.array([0.0, 0.5 * np.pi]))  # fmt: skip
    assert why_not_master(path, 0) == ""
    tilted = Ellipse(semi_axes=(0.02, 0.01)).rotated(0.3)
    assert why_not_master(tilted, 1) == ""
    heart = Heart(radius=0.02, smoothing=0.05)
    assert why_not_master(heart, 0) == ""
    with pytest.raises(RefusedError, match=r"it turns back at .* axis 0 could"):
        master_motion("Law", heart, 1, NAMES)


def model(viscous):
    return NominalModel(
        mass=np.ones(2), viscous=np.array(viscous), coulomb=np.zeros(2), gain=np.ones(2),
        command_limit=np.full(2, 10.0), command="voltage",
    )  # fmt: skip


def test_the_slowest_axis_is_recommended_among_those_that_can():
    circle, heart = Circle(radius=0.02), Heart(radius=0.02, smoothing=0.05)
    assert choose_master("Law", circle, model((5.0, 50.0)), NAMES) == 0
    assert choose_master("Law", circle, model((50.0, 5.0)), NAMES) == 1
    assert choose_master("Law", heart, model((50.0, 5.0)), NAMES) == 0


def test_the_motion_of_a_circle_is_a_cosine_with_its_phase():
    motion = master_motion("Law", Circle(radius=0.02, center=(0.01, 0.0)), 1, NAMES)
    assert motion.rotational
    assert motion.cosine
    assert_allclose([motion.amplitude, motion.centre], [0.02, 0.0], atol=1e-15)
    assert_allclose(motion.phase, -0.5 * np.pi)
    over_length = master_motion("Law", join([Circle(radius=0.02)], closed=True).path, 0, NAMES)
    assert over_length.cosine
    assert_allclose(over_length.angle_rate, 1.0 / 0.02)
    ellipse = join([Ellipse(semi_axes=(0.02, 0.01))], closed=True).path
    assert not master_motion("Law", ellipse, 1, NAMES).cosine  # over its arc length
    ramp = master_motion("Law", Sinusoid(amplitude=0.01, wavelength=0.02), 0, NAMES)
    assert not ramp.rotational


def test_arcs_of_a_path_can_have_a_master():
    """The round trip of a path of lines and arcs is looked up piece by piece."""
    full = Circle(radius=0.02)
    path = full.between(0.2, 2.9)
    where = domain(path)
    assert not where.motion.rotational
    reference = np.linspace(0.3, 2.7, 100)
    position = 0.02 * np.cos(reference - 0.01)
    assert_allclose(located(where, position, reference)[1:], reference[1:] - 0.01, atol=1e-12)


def test_where_a_monotone_masters_slope_vanishes_noise_does_no_more_than_at_a_turn():
    """Half a circle, of which the master's slope is 0 at both ends: σ / (ε S) there too."""
    half = Circle(radius=0.02).between(0.0, np.pi)
    reference = np.linspace(0.0, np.pi, 3000)
    noise = 1e-8 * np.random.default_rng(2).normal(size=reference.size)
    found = located(domain(half), 0.02 * np.cos(reference) + noise, reference)
    assert np.max(np.abs(found - reference)) < 5.0 * 1e-8 / (0.03 * 0.02)


def test_over_arc_length_the_arccosine_takes_the_angle():
    """A circle of 20 mm as a path: the lag is found in metres of arc."""
    path = join([Circle(radius=0.02)], closed=True).path
    s = 0.02 * T[:1500]
    found = located(domain(path, "arccos"), 0.02 * np.cos((s - 4e-5) / 0.02), s)
    assert np.max(np.abs(found - (s - 4e-5))[10:]) < 1e-9


def test_a_monotone_master_beyond_the_end_of_its_path_stays_there():
    """Half a circle: its master begins at a standstill, and an encoder shows 10 nm more."""
    half = Circle(radius=0.02).between(0.0, np.pi)
    shown = 0.02 * np.cos(1e-3) + np.array([0.0, 1e-8, -1e-8, 1e-8, 1e-6])
    found = located(domain(half), shown, np.full(5, 1e-3))
    assert np.max(np.abs(found)) < 0.05
    ahead = 0.02 * np.cos(np.array([1.0, 1.1]))
    assert_allclose(located(domain(half), ahead, [1.05, 1.05]), [1.0, 1.1], rtol=0, atol=1e-12)
