"""A component in LinuxCNC's servo thread: the numbers of the same C in Python, and those of JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import contourlab as cl
from contourlab.export.generate import generate
from contourlab.export.law_facts import LawFacts
from contourlab.export.linuxcnc import LinuxcncOptions
from contourlab.export.linuxcnc_servo import FAULTS, ServoLayer
from contourlab.export.linuxcnc_session import build_component, missing_linuxcnc, run_private
from contourlab.export.linuxcnc_thread import run_in_servo_thread
from contourlab.recordings.reference import ReferencePoint
from contourlab.recordings.sample import Sample

from .probe_law import T, facts, probe

pytestmark = [
    pytest.mark.linuxcnc,
    pytest.mark.skipif(missing_linuxcnc() is not None, reason=str(missing_linuxcnc())),
]
N = 1200
PEAK = 1e-12
"""Of the peak command: what exported C and JAX may differ by (design, section 10)."""


PLACE = ("parameter", "parameter_rate", "parameter_acceleration")
POINT = ("position", "velocity", "acceleration", "jerk")


def sample_of(order, n, row):
    """Return one instant of what the law was given; what it does not read is 0."""

    def value(name, *shape):
        return jnp.asarray(row[name]).reshape(shape) if name in row else jnp.zeros(shape)

    reference = ReferencePoint(
        **{k: value(f"reference_{k}") for k in PLACE},
        **{k: value(f"reference_{k}", n) for k in POINT},
    )
    return Sample(
        time=value("time"), reference=reference, geometry=value("geometry", order + 1, n),
        preview=jax.tree.map(lambda x: jnp.zeros((0, *x.shape)), reference),
        position=value("position", n), velocity=value("velocity", n),
    )  # fmt: skip


def law_and_code(controller, prefix):
    bound = controller.bind(cl.contours.Circle(radius=0.02), T)
    sample = sample_of(controller.needs.derivatives, controller.n_axes, {})
    return bound, generate(bound, sample, sample_time=T, prefix=prefix)


def motion(servo, n_axes):
    """Return a planner's motion, an arc in the first two axes, and a machine that follows it."""
    rng = np.random.default_rng(11)
    t = np.arange(N) * T
    rows = servo.inputs(N, T)
    angle = 4.0 * t**2
    rate = 8.0 * t
    radial = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    along = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    rows["reference_position"][:, :2] = 20.0 * radial
    rows["reference_velocity"][:, :2] = 20.0 * rate[:, None] * along
    rows["reference_acceleration"][:, :2] = 20.0 * (8.0 * along - rate[:, None] ** 2 * radial)
    rows["position"] = rows["reference_position"] + 0.02 * np.sin(
        np.outer(t, [11.0, 17.0, 23.0][:n_axes])
    )
    rows["position"] = np.round((rows["position"] + rng.normal(0, 1e-4, (N, n_axes))) / 1e-4) * 1e-4
    rows["enable"][10:] = 1
    return rows


@pytest.fixture(scope="module")
def machine():
    return cl.machines.linear_motor_stage()


@pytest.fixture(scope="module")
def controllers(machine):
    axis = cl.controllers.AxisPid.by_pole_placement(
        machine.nominal, 30.0, derivative_cutoff_hz=500.0, velocity_feed_forward=1.0,
        acceleration_feed_forward=1.0, friction_feed_forward=0.8,
    )  # fmt: skip
    circle = cl.contour_errors.OsculatingCircleEstimator()
    return {
        "cross_coupled": cl.controllers.CrossCoupled(
            axis=axis, estimator=circle, kp=6e5, ki=1e6, kd=1500.0, derivative_cutoff_hz=500.0
        ),
        "natural_local": cl.controllers.NaturalLocalTaskFrame(
            model=machine.nominal, bandwidth_hz=(15.0, 60.0)
        ),
    }


@pytest.fixture(scope="module", params=["cross_coupled", "natural_local"])
def run(request, controllers, tmp_path_factory):
    """One law: in the servo thread, on the desk, and what JAX makes of the same inputs."""
    controller = controllers[request.param]
    bound, generated = law_and_code(controller, request.param)
    folder = tmp_path_factory.mktemp(request.param)
    servo = ServoLayer.made(
        generated, LawFacts.of(controller, bound), LinuxcncOptions(license="GPL"), folder
    )
    rows = motion(servo, 2)
    desk = servo.run(rows)
    module = build_component(folder / f"{request.param}.comp")
    thread = run_in_servo_thread(module, rows, folder=folder)
    given = desk["law_inputs"][10:]  # enabled
    columns = {name: jnp.asarray(given[name]) for name in given.dtype.names}

    @jax.jit
    def replayed(columns):
        def step(state, row):
            command, after = bound.step(state, sample_of(controller.needs.derivatives, 2, row))
            return after, command

        first = sample_of(controller.needs.derivatives, 2, {k: v[0] for k, v in columns.items()})
        return jax.lax.scan(step, bound.init(first), columns)[1]

    return rows, desk, thread, np.asarray(replayed(columns))


def test_the_thread_gives_the_numbers_of_python_bit_for_bit(run):
    _, desk, thread, _ = run
    for name in ("command", "following_error", "running", "fault", "saturated"):
        assert_array_equal(thread[name], desk[name], err_msg=name)
    assert_array_equal(thread["status"], desk["law"]["status"])
    assert thread["running"][10:].all()
    assert np.abs(thread["command"]).max() > 1.0


def test_and_those_of_jax(run):
    _, _, thread, jax_command = run
    peak = np.abs(jax_command).max()
    assert_allclose(thread["command"][10:], jax_command, rtol=0, atol=PEAK * peak)
    assert_array_equal(thread["command"][:10], 0.0)


@pytest.fixture(scope="module")
def component(tmp_path_factory):
    """The law written by hand, built, and on the desk."""
    folder = tmp_path_factory.mktemp("component")
    servo = ServoLayer.made(probe(), facts(), LinuxcncOptions(license="GPL"), folder)
    return servo, build_component(folder / "probe.comp"), folder


def test_faults_and_limits_in_the_thread(component):
    servo, module, folder = component
    rows = motion(servo, 2)[:500]
    rows["enable"][:5] = 0
    rows["position"][100, 1] = np.nan
    rows["enable"][200] = 0
    rows["position"][300, 0] += 2.0
    rows["enable"][400] = 0
    settings = {"command-limit-0": 0.05, "law.kp-1": 5000.5}
    servo.restart()
    servo.settings["command_limit"][0] = 0.05
    servo.settings["law"]["kp"][1] = 5000.5
    desk = servo.run(rows)
    thread = run_in_servo_thread(module, rows, folder=folder, settings=settings)
    for name in ("command", "following_error", "running", "fault", "saturated"):
        assert_array_equal(thread[name], desk[name], err_msg=name)
    assert set(thread["fault"]) == {0, *map(FAULTS.index, ("input not finite", "following error"))}
    assert thread["saturated"].any()
    assert_array_equal(thread["command"][thread["running"] == 0], 0.0)


def test_the_hal_file_loads(component, tmp_path):
    """The exported HAL file, after motmod, as an .ini would load it."""
    _, module, folder = component
    hal = tmp_path / "all.hal"
    hal.write_text(
        "loadrt trivkins coordinates=xy\nloadrt tpmod\nloadrt homemod\n"
        "loadrt motmod servo_period_nsec=1000000 num_joints=2\n"
        "addf motion-command-handler servo-thread\naddf motion-controller servo-thread\n"
        f"source {folder / 'probe.hal'}\nshow thread\nshow sig\n"
    )
    said = run_private(
        ["halrun", "-f", str(hal)], modules=[module], folder=tmp_path, timeout=30.0
    ).stdout
    threads = said[: said.index("Signals:")]
    order = [threads.index(name) for name in ("motion-controller", "probe.cycle")]
    assert order == sorted(order)
    for link in (
        "joint.0.amp-enable-out",
        "probe.reference-acceleration-1",
        "joint.1.amp-fault-in",
    ):
        assert link in said


def test_another_period_does_not_run(component):
    servo, module, folder = component
    rows = motion(servo, 2)[:100]
    rows["period"] = 0.5e-3
    thread = run_in_servo_thread(module, rows, folder=folder)
    assert_array_equal(thread["fault"][10:], FAULTS.index("wrong thread period"))
    assert_array_equal(thread["command"], 0.0)
