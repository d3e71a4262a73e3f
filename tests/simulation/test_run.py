"""One closed loop: timing, closed forms, an independent loop, divergence, refusals."""

import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import contourlab as cl
from contourlab.configuration import static
from contourlab.contours import Circle
from contourlab.errors import RefusedError, SimulationError, TravelError
from contourlab.machines import Drive, LinearTool, StepDisturbance
from contourlab.recordings import Reference
from contourlab.simulation.loop import Rows, first_carry, geometry_rows, run_chunk, split

from .loops import Proportional, Pulse, line_reference, velocity_stage


def test_command_k_acts_between_its_sample_and_the_next():
    recording = cl.simulate(velocity_stage(), Pulse(at=3), line_reference(n=10))
    actual = np.asarray(recording["actual"])[:, 0]
    assert_array_equal(actual[:4], 0.0)
    assert actual[4] > 0.0
    # τ v' + v = 1 over one period, from rest
    tau, dt = 0.01, 1e-3
    assert_allclose(actual[4], dt - tau * (1.0 - np.exp(-dt / tau)), rtol=1e-12)


@pytest.mark.parametrize("samples", [1, 2])
def test_a_computing_delay_shifts_the_answer(samples):
    delayed = velocity_stage(drive=Drive(command="velocity", computing_delay=samples * 1e-3))
    now = np.asarray(cl.simulate(velocity_stage(), Pulse(at=3), line_reference(n=20))["actual"])
    late = np.asarray(cl.simulate(delayed, Pulse(at=3), line_reference(n=20))["actual"])
    assert_allclose(late[samples:], now[:-samples], atol=1e-18)


def test_equal_axes_lag_along_a_line_and_keep_on_it():
    velocity, k = np.array([0.02, 0.01]), 40.0
    recording = cl.simulate(velocity_stage(), Proportional(k=k), line_reference(velocity, n=2000))
    # the lag of a P loop on a velocity drive is v / k in steady state
    assert_allclose(np.asarray(recording["tracking_error"])[-1], velocity / k, rtol=1e-6)
    assert recording.metrics["contour_error_max"] < 1e-15


def test_unequal_gains_leave_the_line_by_the_textbook_amount():
    velocity, k = np.array([0.02, 0.01]), np.array([40.0, 50.0])
    recording = cl.simulate(velocity_stage(), Proportional(k=k), line_reference(velocity, n=2000))
    lag = velocity / k
    tangent = velocity / np.linalg.norm(velocity)
    # vector from actual to foot along the left normal; lag = reference - actual
    signed = lag @ np.array([-tangent[1], tangent[0]])
    assert_allclose(np.asarray(recording["contour_error"])[-1], signed, rtol=1e-6)


def test_against_a_loop_written_by_hand():
    k, tau, dt = np.array([30.0, 45.0]), np.array([0.01, 0.02]), 1e-3
    contour = Circle(radius=0.02, center=(0.0, 0.0))
    reference = cl.feedrate.constant_rate(contour, rate=6.0, duration=1.3, sample_time=dt)
    recording = cl.simulate(velocity_stage(tuple(tau)), Proportional(k=k), reference)
    wanted = np.asarray(reference.position)
    q, v = wanted[0].copy(), np.zeros(2)
    decay = np.exp(-dt / tau)
    rows = []
    for point in wanted:
        rows.append(q.copy())
        u = k * (point - q)
        q = q + u * dt + (v - u) * tau * (1.0 - decay)
        v = u + (v - u) * decay
    assert_allclose(np.asarray(recording["actual"]), rows, atol=1e-15)
    exact = 0.02 - np.linalg.norm(rows, axis=1)  # inside: the foot is outward, to the right
    assert_allclose(np.asarray(recording["contour_error"]), -exact, atol=1e-15)


def test_a_longer_run_is_the_same_at_its_start():
    short = cl.simulate(velocity_stage(), Proportional(k=30.0), line_reference(n=300))
    long = cl.simulate(velocity_stage(), Proportional(k=30.0), line_reference(n=1500))
    assert_allclose(
        np.asarray(short["actual"]), np.asarray(long["actual"])[:300], rtol=0, atol=1e-16
    )
    assert short.n_samples == 300
    assert long.n_samples == 1500


def test_preview_is_the_reference_ahead_and_rests_at_the_end():
    reference = line_reference(n=300)
    recording = cl.simulate(velocity_stage(), Proportional(k=30.0, preview=5), reference)
    wanted = np.asarray(reference.position)
    ahead = np.concatenate([wanted[5:], np.repeat(wanted[-1:], 5, axis=0)])
    assert_array_equal(np.asarray(recording["ahead"]), ahead)


def test_telemetry_status_and_warnings_are_recorded():
    recording = cl.simulate(velocity_stage(), Proportional(k=30.0), line_reference(n=50))
    assert_array_equal(np.asarray(recording["count"]), np.arange(1, 51))
    assert_array_equal(np.asarray(recording["status"])[:4], [0, 0, 1, 0])
    assert recording.warnings == ("odd during 2 % of the samples",)
    assert recording.dataset.attrs["contourlab"] == cl.__version__


def test_a_law_that_arrives_early_ends_the_run():
    law = Proportional(k=30.0, stop_at=20)
    assert cl.simulate(velocity_stage(), law, line_reference(n=50)).n_samples == 20


def test_a_diverging_run_stops_and_says_when_and_where():
    # beyond the sampled stability limit of the P loop, on Y only
    law = Proportional(k=np.array([30.0, 5000.0]))
    recording = cl.simulate(velocity_stage(), law, line_reference(n=3000))
    assert recording.diverged
    assert recording.n_samples < 3000
    assert "on axis Y" in recording.status
    assert any("diverged" in warning for warning in recording.warnings)
    assert np.isnan(recording.metrics["contour_error_rms"])
    assert np.isfinite(np.asarray(recording["actual"])).all()


def test_nan_from_a_law_is_reported():
    class Broken(Proportional):
        def bind(self, contour, sample_time):
            bound = super().bind(contour, sample_time)
            return BrokenBound(law=bound.law)

    from .loops import BoundProportional

    class BrokenBound(BoundProportional):
        def step(self, state, sample):
            command, state = super().step(state, sample)
            return jnp.where(state["step"] > 10, jnp.nan, command), state

    recording = cl.simulate(velocity_stage(), Broken(k=1.0), line_reference(n=50))
    assert recording.diverged
    assert "0.011 s" in recording.status


def test_disturbances_act_on_schedule():
    push = StepDisturbance(axis=1, amplitude=0.5, start=0.1, stop=0.2)
    reference = line_reference((0.0, 0.0001), n=300)
    recording = cl.simulate(velocity_stage(), Proportional(k=0.0), reference, disturbances=[push])
    y = np.asarray(recording["actual"])[:, 1]
    assert_array_equal(y[:101], 0.0)
    assert y[102] > 0.0
    assert_allclose(y[-1], 0.05, rtol=1e-3)  # effort 0.5 on viscous 1 for 0.1 s


def test_progress_reaches_one():
    seen = []
    cl.simulate(velocity_stage(), Proportional(k=30.0), line_reference(n=600), progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_gradients_go_through_the_loop():
    reference = line_reference(n=60)
    machine, law = velocity_stage(), Proportional(k=30.0)
    chunk = split(reference, 60, 0)[0]
    needs = law.needs

    def loss(k):
        bound_machine = machine.bind(1e-3)
        bound = cl.replace(law, k=k).bind(reference.contour, 1e-3)
        rows = Rows(chunk, geometry_rows(reference.contour, jnp.asarray(chunk.parameter), 1))
        carry = first_carry(bound_machine, bound, rows, jax.random.key(0), needs)
        _, out = run_chunk(
            bound_machine, bound, (), carry, rows, 1e-3, 1.0, needs=needs, n_steps=60, freeze=False
        )
        return jnp.sum((out["actual"] - chunk.position) ** 2) * 1e6

    step = 1e-4
    slope = (loss(30.0 + step) - loss(30.0 - step)) / (2 * step)
    assert_allclose(jax.grad(loss)(30.0), slope, rtol=1e-6)  # central difference, 1e-8 relative
    assert_allclose(jax.jacfwd(loss)(30.0), slope, rtol=1e-6)


def test_runs_without_compiling():
    reference = line_reference(n=6)
    compiled = np.asarray(cl.simulate(velocity_stage(), Proportional(k=30.0), reference)["actual"])
    machine, law = velocity_stage().bind(1e-3), Proportional(k=30.0).bind(reference.contour, 1e-3)
    chunk = split(reference, 6, 0)[0]
    with jax.disable_jit():
        rows = Rows(
            jax.tree.map(jnp.asarray, chunk),
            geometry_rows(reference.contour, jnp.asarray(chunk.parameter), 1),
        )
        needs = Proportional(k=30.0).needs
        carry = first_carry(machine, law, rows, jax.random.key(0), needs)
        _, out = run_chunk(
            machine, law, (), carry, rows, 1e-3, 1.0, needs=needs, n_steps=6, freeze=True
        )
    assert_allclose(out["actual"], compiled, atol=1e-16)


def test_four_axes_drive_a_planar_tool():
    reference = line_reference(n=200)
    wide = np.concatenate([np.asarray(reference.position), np.zeros((200, 2))], axis=1)
    zeros = np.zeros((200, 4))
    four = cl.replace(reference, position=wide, velocity=zeros, acceleration=zeros, jerk=zeros)
    machine = velocity_stage(
        (0.02, 0.02, 0.001, 0.001),
        names=("X", "Y", "U", "V"),
        tool=LinearTool(matrix=[[1, 0, 1, 0], [0, 1, 0, 1]]),
    )
    with pytest.raises(RefusedError, match="takes no account of a tool map"):
        cl.simulate(machine, Proportional(k=np.full(4, 40.0), axes=4), four)
    law = Proportional(k=np.full(4, 40.0), axes=4, tool_map=True)
    recording = cl.simulate(machine, law, four)
    assert recording["tool"].shape == (200, 2)
    assert recording.metrics["contour_error_max"] < 1e-15
    assert_allclose(
        np.asarray(recording["tool"]), np.asarray(recording["actual"])[:, :2], atol=1e-18
    )


def test_a_tool_that_is_not_on_the_contour_is_refused():
    swapped = velocity_stage(tool=LinearTool(matrix=[[0.0, 1.0], [1.0, 0.0]]))
    with pytest.raises(RefusedError, match="do not put the tool on the contour"):
        cl.simulate(swapped, Proportional(k=1.0, tool_map=True), line_reference())


def test_nan_in_the_last_command_or_in_telemetry_is_reported():
    from .loops import BoundProportional

    class Spoilt(Proportional):
        last: bool = static(default=True)

        def bind(self, contour, sample_time):
            return BoundSpoilt(law=self)

    class BoundSpoilt(BoundProportional):
        def step(self, state, sample):
            command, state = super().step(state, sample)
            bad = (state["step"] == 50) & self.law.last
            return jnp.where(bad, jnp.nan, command), state

        def telemetry(self, state):
            count = jnp.where(state["step"] > 20, jnp.nan, 0.0)
            return {"count": count if not self.law.last else count * 0.0 + 0.0}

    recording = cl.simulate(velocity_stage(), Spoilt(k=30.0), line_reference(n=50))
    assert recording.status == "not finite"
    assert any("command is not finite on axis X from 0.049 s" in w for w in recording.warnings)
    recording = cl.simulate(velocity_stage(), Spoilt(k=30.0, last=False), line_reference(n=50))
    assert any("count is not finite from 0.02 s" in w for w in recording.warnings)


def test_the_machine_itself_leaving_its_travel_is_reported():
    reference = line_reference((0.0, 0.01), n=200)
    machine = velocity_stage(travel=[[-1.0, 1.0], [-0.001, 0.002]])
    push = StepDisturbance(axis=1, amplitude=0.5, start=0.0, stop=0.1)
    recording = cl.simulate(machine, Proportional(k=5.0), reference, disturbances=push)
    assert any("axis Y left its travel by up to" in w for w in recording.warnings)


def test_a_plan_is_taken_as_its_reference_and_the_scenario_is_kept():
    contour = cl.contours.Line(start=(0.0, 0.0), end=(0.01, 0.01))
    limits = cl.feedrate.AxisLimits(velocity=0.1, acceleration=1.0, jerk=100.0)
    plan = cl.feedrate.plan_feed(contour, limits=limits, sample_time=1e-3, feed="1000 mm/min")
    law = Proportional(k=30.0)
    recording = cl.simulate(velocity_stage(), law, plan, scenario="text")
    assert recording.dataset.attrs["scenario"] == "text"
    assert recording.dataset.attrs["controller"] == "proportional"
    comparison = cl.compare(velocity_stage(), [law], plan)
    assert comparison.stops == tuple(plan.stop_times)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((velocity_stage(), None, line_reference()), "controller must be a Controller, got None"),
        (("stage", Proportional(k=1.0), line_reference()), "machine must be a Machine, got str"),
    ],
)
def test_what_is_no_part_of_a_loop_is_named(arguments, message, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for a user
    with pytest.raises(SimulationError, match=message):
        cl.simulate(*arguments)
    with pytest.raises(SimulationError, match=r"seed must be a whole number >= 0, got 1\.5"):
        cl.simulate(velocity_stage(), Proportional(k=1.0), line_reference(), seed=1.5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"law": Proportional(k=1.0, axes=3)}, "commands 3 axes, the machine has 2"),
        ({"machine": velocity_stage((0.01,))}, "commands 2 axes, the machine has 1"),
        (
            {"machine": velocity_stage(drive=Drive(command="force"))},
            "gives a velocity command, the machine takes a force command",
        ),
        ({"reference": line_reference((1.0, 1.0, 1.0))}, "the reference has 3 axes"),
        (
            {"machine": velocity_stage(tool=LinearTool(matrix=[[1.0, 0.0]]))},
            "the contour has 2 coordinates, the tool has 1",
        ),
    ],
)
def test_what_does_not_go_together_is_refused(change, message):
    parts = {
        "machine": velocity_stage(), "law": Proportional(k=1.0), "reference": line_reference(),
    } | change  # fmt: skip
    with pytest.raises(RefusedError, match=message):
        cl.simulate(parts["machine"], parts["law"], parts["reference"])


def test_travel_is_checked_with_its_axis():
    machine = velocity_stage(travel=[[-1.0, 1.0], [-1.0, 0.002]])
    with pytest.raises(TravelError, match=r"axis Y, -1000 to 2 mm: it goes to 3\.99 mm"):
        cl.simulate(machine, Proportional(k=1.0), line_reference(n=400))


def test_a_contour_is_no_reference(monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for a user
    with pytest.raises(SimulationError, match="reference must be a Reference"):
        cl.simulate(velocity_stage(), Proportional(k=1.0), Circle(radius=1.0))


def test_a_disturbance_on_no_axis_is_refused():
    push = StepDisturbance(axis=2, amplitude=1.0)
    with pytest.raises(cl.errors.ContourlabError, match="acts on axis 2, the machine has 2 axes"):
        cl.simulate(velocity_stage(), Proportional(k=1.0), line_reference(), disturbances=[push])


def test_the_global_contour_error_sees_the_other_branch():
    # a hairpin of two lines 1 mm apart; the machine is pushed towards the other line
    hairpin = cl.contours.Path.polyline([[0.0, 0.0], [0.05, 0.0], [0.05, 0.001], [0.0, 0.001]])
    n = 200
    zero = np.zeros(n)
    reference = Reference.along(
        hairpin, sample_time=1e-3, parameter=1e-3 + 0.02 * np.arange(n) * 1e-3,
        parameter_rate=np.full(n, 0.02), parameter_acceleration=zero, parameter_jerk=zero,
    )  # fmt: skip
    push = StepDisturbance(axis=1, amplitude=0.02, start=0.0)
    recording = cl.simulate(velocity_stage(), Proportional(k=25.0), reference, disturbances=push)
    local = np.abs(np.asarray(recording["contour_error"]))
    everywhere = np.abs(recording.global_contour_error(hairpin))
    assert_allclose(local[-1], 0.0008, rtol=0.01)  # 0.02 / 25, nearly settled
    assert_allclose(everywhere[-1], 0.001 - local[-1], rtol=1e-9)
    assert (everywhere <= local + 1e-15).all()
