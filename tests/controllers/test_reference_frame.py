"""The frame along a contour: its motion by differences, and what it does without a normal."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.contours import Ellipse, Path
from contourlab.controllers import FirstOrderTaskFrame, NaturalLocalTaskFrame, ReferenceFrame
from contourlab.machines import Drive, Encoder, Machine, RigidAxes
from contourlab.recordings import Reference
from contourlab.testing.samples import make_samples

from .task_frame_material import OvalHelix

T = 1e-3
NEEDS = cl.controllers.Needs(command="force", derivatives=5)


def frame(n_axes, sample_time=T, twist_limit=90.0, return_rate=40.0):
    return ReferenceFrame(
        n_axes=n_axes, sample_time=sample_time, twist_limit=twist_limit, return_rate=return_rate
    )


@jax.jit
def moved(frame, samples):
    """All frames and states along stacked samples."""
    first = jax.tree.map(lambda x: x[0], samples)

    def step(state, sample):
        motion, state = frame.step(state, sample)
        return state, (motion, state)

    samples = jax.tree.map(jnp.asarray, samples)
    return jax.lax.scan(step, frame.init(first), samples)[1]


def along(contour, start, rate, acceleration, n, sample_time):
    time = np.arange(n) * sample_time
    return Reference.along(
        contour, sample_time=sample_time,
        parameter=start + rate * time + acceleration * time**2 / 2,
        parameter_rate=rate + acceleration * time, parameter_acceleration=np.full(n, acceleration),
        parameter_jerk=np.zeros(n),
    )  # fmt: skip


def samples_of(contour, reference, sample_time):
    return make_samples(
        contour, reference.n_samples, sample_time, NEEDS, reference=reference,
        error=np.zeros(contour.n_axes),
    )  # fmt: skip


@pytest.mark.parametrize("rate", [5.0, -5.0])
@pytest.mark.parametrize("contour", [Ellipse(semi_axes=(0.03, 0.01)), OvalHelix()])
def test_turning_and_its_rate_are_those_of_the_frame(contour, rate):
    """R' and R'' by central differences over a reference that accelerates."""
    dt = 1e-4
    reference = along(contour, 2.0, rate, 40.0, 60, dt)
    motion, state = moved(frame(contour.n_axes, dt), samples_of(contour, reference, dt))
    r = np.asarray(motion.rotation)
    w, w_1 = np.asarray(motion.turning), np.asarray(motion.turning_rate)
    assert_allclose(
        np.einsum("kij,kil->kjl", r, r),
        np.broadcast_to(np.eye(contour.n_axes), r.shape),
        atol=1e-14,
    )
    first = (r[2:] - r[:-2]) / (2.0 * dt)
    second = (r[2:] - 2.0 * r[1:-1] + r[:-2]) / dt**2
    # truncation of the differences, dt² times two derivatives more, of rates of some 20 1/s
    assert_allclose(first, (r @ w)[1:-1], rtol=0, atol=3e-4)
    assert_allclose(second, (r @ (w @ w + w_1))[1:-1], rtol=0, atol=3e-2)
    if contour.n_axes == 3:
        wanted = jax.vmap(contour.frenet)(jnp.asarray(reference.parameter))
        assert_allclose(r[:, :, 1], wanted.normal, rtol=0, atol=1e-13)
        assert np.all(np.asarray(state.offset) == 0.0)


def test_components_are_differentiated_over_time():
    """κ of the ellipse, as the component of r_ss along the normal, against its differences."""
    contour, dt = Ellipse(semi_axes=(0.03, 0.01)), 1e-4
    motion, _ = moved(frame(2, dt), samples_of(contour, along(contour, 0.4, 5.0, 40.0, 60, dt), dt))
    rows = motion.rows
    x, x_1, x_2 = jax.vmap(lambda m: m.components(m.rows[2], m.rows[3], m.rows[4]))(motion)
    curvature = np.einsum("ki,ki->k", rows[:, 2], motion.rotation[:, :, 1])
    assert_allclose(x[:, 1], curvature, rtol=1e-13)
    # along the tangent it is 0 and stays so: rounding of terms of size W W x
    size = np.max(np.abs(x_2[:, 1]))
    assert_allclose(x[:, 0], 0.0, atol=1e-12)
    assert_allclose(x_2[:, 0], 0.0, atol=1e-10 * size)
    change = (curvature[2:] - curvature[:-2]) / (2.0 * dt)
    assert_allclose(x_1[1:-1, 1], change, rtol=1e-4)
    again = (curvature[2:] - 2.0 * curvature[1:-1] + curvature[:-2]) / dt**2
    assert_allclose(x_2[1:-1, 1], again, rtol=1e-3, atol=1e-3 * np.max(np.abs(again)))


# -- no principal normal -----------------------------------------------------------------------


def wave(lift):
    """A spline over a wave: curvature nearly vanishes at x = 0, by as much as it is lifted."""
    x = np.linspace(-0.03, 0.03, 6)
    y = np.array([0.0, -0.02, -0.02, 0.02, 0.02, 0.0])
    z = lift * np.array([0.0, 1.0, -1.0, -1.0, 1.0, 0.0])
    control = np.stack([x, y, z], axis=1)
    return Path.from_bezier(control[None])


def line_arc_arc():
    """A straight line, an arc in the XY plane and one in a plane that stands on it."""
    u = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    v = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    w = np.zeros((3, 3))
    rate = np.array([0.0, 50.0, 50.0])
    length = np.array([0.02, 0.01 * np.pi, 0.01 * np.pi])
    start = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.04, 0.02, 0.0]])
    return Path.from_helical(start, u, v, w, rate, length)


def run_over(path, n=801):
    length = float(path.length)
    return along(path, 0.0, length / ((n - 1) * T), 0.0, n, T)


@pytest.mark.parametrize("path", [wave(0.0), wave(1e-4), line_arc_arc()])
def test_the_frame_goes_on_where_there_is_no_principal_normal(path):
    """No jump anywhere, W is what turns R, and the frame is Frenet's again in the end."""
    reference = run_over(path)
    motion, state = moved(frame(3), samples_of(path, reference, T))
    r, w = np.asarray(motion.rotation), np.asarray(motion.turning)
    step = np.einsum("kji,kjl->kil", r[:-1], r[1:])  # from frame to frame
    size = np.arccos(np.clip((np.trace(step, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
    rate = np.sqrt(np.sum(w**2, axis=(1, 2)) / 2.0)
    # the frame turns by what its rates say, at either end of the step (curvature may jump within)
    assert np.all(size < 1.02 * T * np.maximum(rate[1:], rate[:-1]) + 2e-4)
    principal = np.asarray(jax.vmap(path.frenet)(jnp.asarray(reference.parameter)).normal)
    aligned = np.abs(np.sum(principal * r[:, :, 1], axis=1))
    assert aligned[-1] > 1.0 - 1e-4
    assert np.max(np.abs(np.asarray(state.twist))) < 90.0 + 40.0
    # the principal normal itself turns over, or jumps, or is not there
    turns = np.sum(principal[1:] * principal[:-1], axis=1)
    assert turns.min() < 0.9


def test_a_planar_wave_in_space_has_the_frame_of_the_plane():
    """Through a true inflection the normal keeps its side: the curvature is signed."""
    path = wave(0.0)
    motion, _ = moved(frame(3), samples_of(path, run_over(path), T))
    side = np.asarray(motion.rotation)[:, :, 2] @ np.array([0.0, 0.0, 1.0])
    assert_allclose(side, side[0], rtol=0, atol=1e-9)
    bend = np.asarray(motion.turning)[:, 1, 0]
    assert bend.min() < 0.0 < bend.max()


@pytest.mark.slow
def test_the_laws_stay_decoupled_across_an_inflection_in_space():
    """Perfect model: z_1 is thrown back by a start on the run, z_2 and z_3 feel nothing of it."""
    path = wave(5e-4)
    machine = Machine(
        names=("X", "Y", "Z"), dynamics=RigidAxes(mass=[1.0, 1.5, 2.0], viscous=20.0),
        drive=Drive(command="force"), sensor=Encoder(velocity="ideal"),
    )  # fmt: skip
    dt, n = 1e-4, 3001
    middle = 0.5 * float(path.length)
    reference = along(path, middle - 0.012, 0.12, 0.0, n, dt)
    law = NaturalLocalTaskFrame(model=machine.nominal, bandwidth_hz=(4.0, 15.0, 12.0))
    recording = cl.simulate(machine, law, reference)
    z, status = np.abs(np.asarray(recording["task_error"])), np.asarray(recording["status"])
    carried = status == 2
    assert 0.02 < np.mean(carried) < 0.9
    assert z[carried, 0].min() > 2e-4
    # the hold over 0.1 ms, as elsewhere on the path
    assert z[:, 1:].max() < 1e-3 * z[:, 0].max()
    command = np.asarray(recording["command"])
    change = np.linalg.norm(np.diff(command, axis=0), axis=1)[1:]
    entering = np.flatnonzero(np.diff(carried.astype(int)))
    assert len(entering) >= 2
    # at the ends of the carried stretch the command changes as it does all along
    assert change[entering - 1].max() < 3.0 * np.median(change) + 1e-3
    assert any("frame carried on" in warning for warning in recording.warnings)
    plain = FirstOrderTaskFrame(model=machine.nominal, bandwidth_hz=(4.0, 15.0, 12.0))
    first = cl.simulate(machine, plain, reference)
    better = recording.metrics["contour_error_max"]
    assert better < 0.2 * first.metrics["contour_error_max"]
