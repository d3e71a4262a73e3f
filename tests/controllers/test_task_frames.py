"""Global and local task frames: coordinates, rates and turning against closed forms."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours import Circle, Ellipse, FigureEight, Line, Path, foot_point
from contourlab.controllers import GlobalTaskFrame, LocalTaskFrame, Needs
from contourlab.controllers.frames.global_task_frame import arc_between
from contourlab.errors import RefusedError
from contourlab.testing.samples import make_samples, standing

T = 1e-3
ELLIPSE = Ellipse(semi_axes=(0.2, 0.1), center=(0.0, 0.1))
NEEDS = Needs(command="voltage", derivatives=3, contour=True)


@jax.jit
def moved(frame, samples):
    """All coordinates along stacked samples."""
    first = jax.tree.map(lambda x: x[0], samples)

    def step(state, sample):
        here, state = frame.step(state, sample)
        return state, here

    return jax.lax.scan(step, frame.init(first), jax.tree.map(jnp.asarray, samples))[1]


def put(samples, position=None, velocity=None, parameter=None):
    """Stacked samples with other values; dataclasses.replace would check shapes of one."""
    new = {"position": position, "velocity": velocity}
    for name, value in new.items():
        if value is not None:
            samples = eqx.tree_at(lambda s, n=name: getattr(s, n), samples, value)
    if parameter is not None:
        samples = eqx.tree_at(lambda s: s.reference.parameter, samples, parameter)
    return samples


def frames():
    return [
        GlobalTaskFrame(rate_from="velocity"),
        GlobalTaskFrame(form="implicit", rate_from="velocity"),
        LocalTaskFrame(rate_from="velocity"),
    ]


def at(frame, contour, samples):
    return moved(frame.bind(contour, T), samples)


@pytest.mark.parametrize("frame", frames(), ids=["foot", "implicit", "local"])
def test_rates_and_carried_motion_are_the_derivatives(frame):
    """By central differences along a motion that is 5 mm off; the velocity is a true one."""
    n = 4001
    time = np.arange(n) * (T / 20)
    error = 5e-3 * np.stack([np.sin(9 * time), np.cos(7 * time + 1)], 1)
    samples = make_samples(ELLIPSE, n, T / 20, NEEDS, error=error)
    here = at(frame, ELLIPSE, samples)
    inner = slice(1, -1)

    def rate_of(x):
        return (np.asarray(x)[2:] - np.asarray(x)[:-2]) / (T / 10)

    turning = np.asarray(here.turning)[inner]
    jacobian = np.asarray(here.jacobian)
    q = np.array([[0.0, -1.0], [1.0, 0.0]])
    wanted = turning[:, None, None] * (q @ jacobian[inner])
    assert_allclose(rate_of(jacobian), wanted, atol=3e-5 * np.abs(turning).max())
    exact = np.asarray(here.rate)[inner].copy()
    if isinstance(frame, GlobalTaskFrame):
        # the paper's J is that of the contour: the true gradient along is t / (1 + κ r_c) for
        # the distance, and the rate of f/|∇f| is n·q' up to second order in r_c
        rows = np.asarray(jax.vmap(lambda p: ELLIPSE.derivatives(p, 2))(_feet(samples)))
        bend = rows[:, 1, 0] * rows[:, 2, 1] - rows[:, 1, 1] * rows[:, 2, 0]
        focal = 1.0 + bend / np.linalg.norm(rows[:, 1], axis=1) ** 3 * _distance(samples)
        planned = np.einsum("ni,ni->n", jacobian[:, 0], np.asarray(here.carried_velocity))[inner]
        exact[:, 0] = (exact[:, 0] + planned) / focal[inner] - planned
    found = rate_of(here.error)
    if getattr(frame, "form", "") == "implicit":
        # t is not that of the foot there, and r_c' = n·q' - r_c n·H q' / |∇f|
        level = jax.vmap(ELLIPSE.level_derivatives)(samples.position)
        along = np.einsum("ni,nij,nj->n", jacobian[:, 1], level.hessian, samples.velocity)
        size = np.linalg.norm(level.gradient, axis=1)
        exact[:, 1] -= (np.asarray(here.error)[:, 1] * along / size)[inner]
        found, exact = found[:, 1], exact[:, 1]
    assert_allclose(found, exact, atol=1e-5 * np.abs(found).max())
    change = rate_of(here.carried_velocity)
    wanted = np.asarray(here.carried_acceleration)[inner]
    assert_allclose(change, wanted, atol=1e-4 * np.abs(wanted).max())
    # and so is the motion that a course of the error asks for
    slope = np.stack([np.sin(50 * time), 0.7 * np.cos(30 * time)], 1)
    bend = np.stack([50 * np.cos(50 * time), -21 * np.sin(30 * time)], 1)
    velocity, wanted = jax.vmap(lambda c, a, b: c.equivalent_motion(a, b))(here, slope, bend)
    wanted = np.asarray(wanted)[inner]
    assert_allclose(rate_of(velocity), wanted, atol=1e-4 * np.abs(wanted).max())


def _feet(samples):
    foot = foot_point(ELLIPSE, np.asarray(samples.position), near=samples.reference.parameter)
    return jnp.asarray(foot.parameter)


def _distance(samples):
    foot = foot_point(ELLIPSE, np.asarray(samples.position), near=samples.reference.parameter)
    return np.asarray(foot.distance)


def test_the_differenced_rate_is_half_a_sample_late_and_has_no_bias():
    """On a circle at constant speed with the tool on it, differenced velocities see a normal
    speed of T v² / (2 R) that is none; the difference of the coordinate is zero."""
    radius, speed, n = 0.05, 0.4, 40
    contour = Circle(radius=radius)
    angle = speed / radius * T * np.arange(n)
    on = radius * np.stack([np.cos(angle), np.sin(angle)], 1)
    samples = make_samples(contour, n, T, NEEDS, error=np.zeros(2))
    velocity = np.diff(on, axis=0, prepend=on[:1]) / T
    samples = put(samples, on, velocity)
    biased = at(GlobalTaskFrame(rate_from="velocity"), contour, samples).rate[2:, 1]
    assert_allclose(biased, T * speed**2 / (2 * radius), rtol=1e-4)
    free = at(GlobalTaskFrame(rate_from="coordinates"), contour, samples).rate[2:, 1]
    assert np.abs(free).max() < 1e-11


@pytest.mark.parametrize("contour", [ELLIPSE, FigureEight(half_sizes=(0.03, 0.03))])
def test_across_is_the_exact_contour_error(contour):
    samples = make_samples(contour, 200, T, NEEDS, error=np.array([1e-3, -2e-3]))
    here = at(GlobalTaskFrame(), contour, samples)
    foot = foot_point(contour, np.asarray(samples.position), near=samples.reference.parameter)
    assert_allclose(here.error[:, 1], foot.distance, atol=1e-15)
    vector = jax.vmap(lambda c: c.contour_error)(here)
    assert_allclose(vector, foot.vector, atol=1e-15)


# r_c - δ [um] of (x/a)² + (y/b)² - 1 at the bottom (0, 0), where t is along x
@pytest.mark.parametrize(("offset", "wanted"), [(36.0, -0.006478), (1e3, -4.9505), (-1e3, -5.0505)])
def test_the_implicit_coordinate_is_second_order_off(offset, wanted):
    # r_c - δ = -(δ²/2b)(1 + ...): in closed form on the minor axis, f = (1 + δ/b)² - 1
    samples = make_samples(ELLIPSE, 2, T, NEEDS, error=np.zeros(2))
    point = np.array([[0.0, -1e-6 * offset]] * 2)
    samples = put(samples, point, parameter=np.full(2, -np.pi / 2))
    across = at(GlobalTaskFrame(form="implicit"), ELLIPSE, samples).error[0, 1]
    d, b = 1e-6 * offset, 0.1
    closed = ((1 + d / b) ** 2 - 1) * b / (2 * (1 + d / b))
    assert_allclose(across, closed, rtol=1e-10)
    assert_allclose(1e6 * (across - d), wanted, rtol=1e-3)


def test_the_local_frame_does_not_see_the_curvature():
    """A tool on the contour, 5 mm behind: 0 in the global frame, about κ e²/2 in the local."""
    contour = Circle(radius=0.05)
    samples = make_samples(contour, 2, T, NEEDS, error=np.zeros(2))
    angle = np.asarray(samples.reference.parameter) - 5e-3 / 0.05
    point = 0.05 * np.stack([np.cos(angle), np.sin(angle)], 1)
    samples = put(samples, point)
    seen = at(GlobalTaskFrame(), contour, samples).error[0]
    assert_allclose(seen, [-5e-3, 0.0], atol=1e-15)
    local = at(LocalTaskFrame(), contour, samples).error[0]
    assert_allclose(local, [-0.05 * np.sin(0.1), -0.05 * (1 - np.cos(0.1))], atol=1e-15)


def test_the_arc_is_that_of_elliptic_integrals():
    both = jax.jit(lambda a, b: (arc_between(ELLIPSE, a, b), ELLIPSE.arc_length(a, b)))
    for span, rtol in ((0.01, 1e-13), (0.3, 1e-9), (-1.0, 2e-5)):
        found, exact = both(0.7, 0.7 + span)
        assert_allclose(found, exact, rtol=rtol)


def test_a_sum_of_tangential_steps_drifts_and_the_arc_does_not():
    """One round, 10 um outside: the sum of t · dq gains 2π r_c, the coordinate nothing."""
    n = 4001
    phi = np.linspace(0.0, 2 * np.pi, n)
    rows = np.asarray(jax.vmap(lambda p: ELLIPSE.derivatives(p, 1))(jnp.asarray(phi)))
    tangent = rows[:, 1] / np.linalg.norm(rows[:, 1], axis=1)[:, None]
    tool = rows[:, 0] + 1e-5 * np.stack([tangent[:, 1], -tangent[:, 0]], 1)
    middle = 0.5 * (tangent[1:] + tangent[:-1])
    total = np.sum(np.einsum("ni,ni->n", middle, np.diff(tool, axis=0)))
    length = float(ELLIPSE.arc_length(0.0, 2 * np.pi))
    assert_allclose(total - length, 2 * np.pi * 1e-5, atol=2e-6)
    samples = make_samples(ELLIPSE, n, T, NEEDS, error=np.zeros(2))
    samples = put(samples, tool, parameter=phi)
    here = at(GlobalTaskFrame(), ELLIPSE, samples).error
    assert_allclose(here[:, 0], 0.0, atol=1e-14)
    assert_allclose(here[:, 1], 1e-5, atol=1e-14)


def test_beyond_an_open_end_the_coordinates_go_on():
    line = Line(start=(0.0, 0.0), end=(0.03, 0.04))
    samples = make_samples(line, 3, T, NEEDS, error=np.zeros(2))
    beyond = (
        np.array([[0.03, 0.04]] * 3) + 2e-3 * np.array([0.6, 0.8]) + 1e-3 * np.array([0.8, -0.6])
    )
    samples = put(samples, beyond)
    for form in ("foot_point", "implicit"):
        here = at(GlobalTaskFrame(form=form), line, samples)
        behind = np.linalg.norm(
            np.array([0.03, 0.04]) - np.asarray(samples.reference.position), axis=1
        )
        assert_allclose(here.error[:, 0], behind + 2e-3, atol=1e-15)
        assert_allclose(here.error[:, 1], 1e-3, atol=1e-15)


def test_what_cannot_be_framed_is_refused():
    corner = Path.join(
        [Line(start=(0.0, 0.0), end=(0.1, 0.0)), Line(start=(0.1, 0.0), end=(0.1, 0.1))]
    )
    for frame in (GlobalTaskFrame(), LocalTaskFrame()):
        with pytest.raises(RefusedError, match="corner"):
            frame.bind(corner, T)
        with pytest.raises(RefusedError, match="2 coordinates"):
            frame.bind(Line(start=(0.0, 0.0, 0.0), end=(1.0, 0.0, 0.0)), T)
    with pytest.raises(RefusedError, match="has none of its own: use form 'foot_point'"):
        GlobalTaskFrame(form="implicit").bind(FigureEight(half_sizes=(0.03, 0.03)), T)


@pytest.mark.parametrize("frame", frames(), ids=["foot", "implicit", "local"])
def test_the_errors_do_not_depend_on_where_the_contour_lies(frame):
    """Turned and shifted with the tool, errors and rates stay; J turns along."""
    turn, shift = 0.7, np.array([0.3, -0.2])
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    samples = make_samples(ELLIPSE, 50, T, NEEDS, error=np.array([2e-3, 1e-3]))
    center = matrix @ np.array([0.0, 0.1]) + shift
    moved_contour = Ellipse(semi_axes=(0.2, 0.1), center=center, rotation=turn)
    other = make_samples(moved_contour, 50, T, NEEDS, error=matrix @ np.array([2e-3, 1e-3]))
    here, there = at(frame, ELLIPSE, samples), at(frame, moved_contour, other)
    assert_allclose(there.error, here.error, atol=1e-13)
    assert_allclose(there.rate, here.rate, atol=1e-10)
    assert_allclose(there.turning, here.turning, rtol=1e-9)
    assert_allclose(there.jacobian, np.asarray(here.jacobian) @ matrix.T, atol=1e-12)


@pytest.mark.slow
def test_run_backwards_both_errors_change_sign():
    back = ELLIPSE.reversed()
    samples = make_samples(ELLIPSE, 20, T, NEEDS, error=np.array([2e-3, 1e-3]))
    other = make_samples(back, 20, T, NEEDS, error=np.array([2e-3, 1e-3]))
    start, end = ELLIPSE.domain
    parameter = start + end - np.asarray(samples.reference.parameter)
    other = put(other, samples.position, samples.velocity, parameter)
    here = at(GlobalTaskFrame(), ELLIPSE, samples).error
    there = at(GlobalTaskFrame(), back, other).error
    assert_allclose(there, -np.asarray(here), atol=1e-14)


@pytest.mark.parametrize("frame", frames(), ids=["foot", "implicit", "local"])
def test_a_reference_that_stands_is_no_special_case(frame):
    reference = standing(ELLIPSE, 5, T)
    samples = make_samples(ELLIPSE, 5, T, NEEDS, reference=reference, error=np.zeros(2))
    here = at(frame, ELLIPSE, samples)
    for value in jax.tree.leaves(here):
        assert np.all(np.isfinite(value))
    assert_allclose(here.error, 0.0, atol=1e-15)
    assert_allclose(here.carried_velocity, 0.0, atol=1e-15)
    assert_allclose(here.carried_acceleration, 0.0, atol=1e-15)
