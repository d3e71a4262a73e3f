"""The whole loop in C: the same recording as in JAX, for every kind of machine."""

import os
import shutil
import signal
import threading

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import contourlab as cl
from contourlab.configuration import static
from contourlab.contours import Ellipse
from contourlab.controllers import AxisPid, BoundController, Controller
from contourlab.controllers.base import Needs
from contourlab.errors import ConfigurationError, RefusedError, SimulationError
from contourlab.export import CEngine, c_engine, compare_engines, library_cache
from contourlab.feedrate import constant_rate
from contourlab.machines import (
    Drive,
    Encoder,
    Friction,
    GeometricErrors,
    LaggedAxes,
    Machine,
    PositionError,
    PreslidingAxes,
    RigidAxes,
    SineDisturbance,
    Squareness,
    StepDisturbance,
    TwoMassAxes,
)

from .loops import Proportional, TwoVelocities, line_reference, velocity_stage

pytestmark = pytest.mark.skipif(
    cl.export.find_compiler() is None, reason="there is no C compiler here"
)

CONTOUR = Ellipse(semi_axes=(0.03, 0.01), center=(0.1, 0.1))
REFERENCE = constant_rate(CONTOUR, rate=6.0, duration=0.299, sample_time=1e-3)
DRIVE = {"command": "force", "command_limit": (60.0, 50.0)}
DRY = Friction(coulomb=(8.0, 6.0), breakaway=(10.0, 8.0))
RIGID = {"mass": (5.0, 3.0), "viscous": (20.0, 15.0)}


def stage(**changes):
    fields = {
        "names": ("X", "Y"), "dynamics": RigidAxes(**RIGID), "drive": Drive(**DRIVE),
        "sensor": Encoder(velocity="ideal"), "substeps": 4,
    }  # fmt: skip
    return Machine(**{**fields, **changes})


def with_drive(**changes):
    return stage(drive=Drive(**DRIVE, **changes))


PUSHES = (
    StepDisturbance(axis=0, amplitude=20.0, start=0.1),
    SineDisturbance(axis=1, amplitude=5.0, frequency_hz=7.0),
)
MACHINES = {
    "rigid, saturated": lambda: with_drive(),
    "friction": lambda: stage(dynamics=RigidAxes(**RIGID, friction=DRY)),
    "two masses": lambda: stage(
        dynamics=TwoMassAxes(
            motor_mass=(2.0, 1.0), load_mass=(3.0, 2.0), stiffness=2e5, damping=30.0,
            load_viscous=8.0, load_friction=DRY, backlash=2e-6,
        ),
        sensor=Encoder(velocity="ideal", side="motor"),
    ),
    "presliding": lambda: stage(
        dynamics=PreslidingAxes(**RIGID, coulomb=(8.0, 6.0), presliding_distance=1e-5)
    ),
    "a drive that lags": lambda: stage(
        dynamics=LaggedAxes(axes=RigidAxes(**RIGID), time_constant=2e-3)
    ),
    "encoder": lambda: stage(sensor=Encoder(resolution=1e-6)),
    "noise": lambda: stage(
        sensor=Encoder(resolution=1e-7, noise=2e-7, side="tool", velocity_side="motor"),
        dynamics=TwoMassAxes(motor_mass=2.0, load_mass=3.0, stiffness=2e5, damping=30.0),
    ),
    "delay": lambda: with_drive(computing_delay=1.4e-3),
    "geometric errors": lambda: stage(
        errors=GeometricErrors(
            scale=PositionError(scale=1e-5, amplitude=1e-7, period=2e-3),
            squareness=(Squareness(axes=("X", "Y"), angle=5e-5),),
        )
    ),
}  # fmt: skip


def pid(machine, **changes):
    return AxisPid.by_pole_placement(
        machine.nominal, 12.0, derivative_cutoff_hz=200.0, velocity_feed_forward=1.0,
        acceleration_feed_forward=1.0, **changes,
    )  # fmt: skip


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    return CEngine(optimise=1, folder=tmp_path_factory.mktemp("loops"))


@pytest.mark.parametrize("kind", MACHINES)
def test_every_kind_of_machine_moves_as_in_jax(kind, engine):
    machine = MACHINES[kind]()
    pushes = PUSHES if kind in ("rigid, saturated", "friction") else ()
    parity = compare_engines(
        machine, pid(machine), REFERENCE, disturbances=pushes, seed=3, engine=engine
    )
    assert parity.same_length
    assert parity.steps == REFERENCE.n_samples
    assert parity.flipped == ()
    assert parity.differences["actual"] < 1e-12
    # a position's last bit, through the derivative gain: 1e4 N s/m by 1e-17 m in 1 ms, by 20 N
    assert parity.differences["command"] < 3e-12


def test_a_count_that_falls_otherwise_is_listed(engine):
    machine = MACHINES["encoder"]()
    recording = cl.simulate(machine, pid(machine), REFERENCE)
    data = recording.dataset.copy(deep=True)
    data["measured"][200:, 1] += 1e-6
    data["actual"][100:] += 1e-9
    data["actual"][200:] += 1e-3
    found = cl.export.parity_of_recordings(
        recording, cl.recordings.Recording(data), resolution=np.full(2, 1e-6)
    )
    assert [(row, name) for row, name, *_ in found.flipped] == [
        (row, "measured") for row in range(200, REFERENCE.n_samples)
    ]
    assert found.differences["actual"] == pytest.approx(
        1e-9 / np.max(data["actual"].values[:200]), rel=0.1
    )
    assert found.after["actual"] > 1e-3
    assert not found.holds


def same(one, other, *, but=("engine",)):
    """Both recordings hold the same, numbers to rounding."""
    a, b = one.dataset, other.dataset
    assert {k: v for k, v in a.attrs.items() if k not in but} == {
        k: v for k, v in b.attrs.items() if k not in but
    }
    assert list(a.variables) == list(b.variables)
    for name in a.variables:
        x, y = a[name], b[name]
        assert (x.dims, x.dtype, x.attrs) == (y.dims, y.dtype, y.attrs), name
        if x.dtype.kind == "f":
            scale = np.nanmax(np.abs(x.values), initial=1e-3)  # errors of nearly nothing too
            np.testing.assert_allclose(y.values, x.values, rtol=0, atol=1e-11 * scale, err_msg=name)
        else:
            assert_array_equal(x.values, y.values, err_msg=name)


def test_the_recording_has_the_same_columns_and_ends_where_the_law_says(engine):
    machine, reference = velocity_stage(), line_reference(n=400)
    law = Proportional(k=20.0, preview=5, stop_at=300)
    one, other = (
        cl.simulate(machine, law, reference, engine=name, seed=2) for name in ("jax", engine)
    )
    assert one.n_samples == 300
    assert other.dataset.attrs["engine"] == "c"
    assert one.dataset.attrs["engine"] == "jax"
    same(one, other)


def test_a_run_that_diverges_says_so_in_the_same_words(engine):
    machine, reference = velocity_stage(), line_reference(n=400)
    # positive feedback: it leaves its reach of metres at about the 300th row
    one, other = (cl.simulate(machine, Away(), reference, engine=name) for name in ("jax", engine))
    assert one.status.startswith("diverged at")
    assert 256 < one.n_samples < 400
    assert np.isnan(other.metrics["contour_error_rms"])
    same(one, other)


class Away(TwoVelocities):
    """Runs away exponentially, faster on axis 1."""

    def bind(self, contour, sample_time):
        return BoundAway()


class BoundAway(BoundController):
    def init(self, sample):
        return jnp.zeros(())

    def step(self, state, sample):
        return 40.0 * sample.position * jnp.array([1.0, 1.2]) + 1e-3, state


class OwnTime(Controller):
    """Goes along the line at half the reference's pace, and then says that it has arrived."""

    arrives: bool = static(default=True)

    @property
    def needs(self):
        return Needs(command="velocity", own_time=True)

    @property
    def n_axes(self):
        return 2

    def bind(self, contour, sample_time):
        return BoundOwnTime(arrives=self.arrives)


class BoundOwnTime(BoundController):
    arrives: bool = static()

    def init(self, sample):
        return sample.reference.parameter

    def step(self, state, sample):
        return jnp.array([0.01, 0.005]), state + 0.5e-3 * np.hypot(0.02, 0.01)

    def telemetry(self, state):
        return {"path_parameter": state}

    def finished(self, state):
        return self.arrives & (state > 0.0066)


@pytest.mark.parametrize("arrives", [True, False])
def test_a_law_may_plan_its_own_time(engine, arrives):
    machine, reference = velocity_stage(), line_reference(n=300)
    law = OwnTime(arrives=arrives)
    one, other = (cl.simulate(machine, law, reference, engine=name) for name in ("jax", engine))
    assert one.n_samples == (591 if arrives else 1200)
    assert (one.status == "normal") is arrives
    same(one, other)


def test_pieces_of_one_step_give_the_same_run(engine, monkeypatch):
    machine = MACHINES["noise"]()
    whole = cl.simulate(machine, pid(machine), REFERENCE, engine=engine, seed=3)
    monkeypatch.setattr(c_engine, "PIECE", 0.0)
    told = []
    pieces = cl.simulate(
        machine, pid(machine), REFERENCE, engine=engine, seed=3, progress=told.append
    )
    assert len(told) > 30
    assert told[-1] == 1.0
    assert told == sorted(told)
    for name in ("actual", "measured", "command"):
        assert_array_equal(whole[name], pieces[name])


class Slow(TwoVelocities):
    """Takes long over every step, for an interrupt to come in between."""

    def bind(self, contour, sample_time):
        return BoundSlow()


class BoundSlow(BoundController):
    def init(self, sample):
        return jnp.zeros(())

    def step(self, state, sample):
        after = jax.lax.fori_loop(0, 200_000, lambda _, x: jnp.sin(x) + 1e-3, state)
        return jnp.zeros(2), after


def test_an_interrupt_is_heard_on_the_way(engine):
    # a process that a shell started in the background ignores SIGINT
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    told = []
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))

    def progress(done):
        if not told:
            timer.start()
        told.append(done)

    # the whole run would take many times as long
    try:
        with pytest.raises(KeyboardInterrupt):
            cl.simulate(
                velocity_stage(), Slow(), line_reference(n=8_000), engine=engine, progress=progress
            )
    finally:
        timer.join()
        signal.signal(signal.SIGINT, before)
    assert told[-1] < 0.5


class Unwritable(TwoVelocities):
    """Solves by LAPACK, draws by a typed key, or changes its state's type."""

    how: str = static(default="solve")

    def bind(self, contour, sample_time):
        return BoundUnwritable(how=self.how)


class BoundUnwritable(BoundController):
    how: str = static()

    def init(self, sample):
        return jax.random.key(0) if self.how == "key" else jnp.zeros((), jnp.int32)

    def step(self, state, sample):
        if self.how == "solve":
            return jnp.linalg.solve(jnp.eye(2) + sample.position[0], sample.position), state
        if self.how == "key":
            return jax.random.normal(state, (2,)), state
        drawn = jax.random.normal(jax.random.fold_in(jax.random.key(1), state), (2,))
        return drawn, state + 1


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("solve", r"engine c: the primitive \w+ cannot be exported; it comes from .*"
                  r"test_c_engine\.py:\d+"),
        ("key", "holds a random key of JAX's own type"),
        ("fold", r"random_\w+ gives .* cannot be exported \(.*test_c_engine\.py:\d+\)"),
    ],
)  # fmt: skip
def test_what_cannot_be_written_is_refused_with_its_line(engine, how, message):
    with pytest.raises(RefusedError, match=message):
        cl.simulate(velocity_stage(), Unwritable(how=how), line_reference(n=20), engine=engine)


def test_without_a_compiler_it_is_refused(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(RefusedError, match="engine c: no C compiler was found: install gcc"):
        cl.simulate(
            velocity_stage(), Proportional(k=20.0), line_reference(n=20),
            engine=CEngine(folder=tmp_path),
        )  # fmt: skip


@pytest.mark.parametrize(
    ("engine", "error", "message"),
    [
        ("cc", SimulationError, "unknown engine 'cc'; did you mean c"),
        (CEngine, SimulationError, "engine must be a name or an engine"),
    ],
)
def test_an_engine_that_there_is_not(engine, error, message):
    with pytest.raises(error, match=message):
        cl.simulate(velocity_stage(), Proportional(k=20.0), line_reference(), engine=engine)
    with pytest.raises(error, match=message):
        cl.compare(velocity_stage(), [Proportional(k=20.0)], line_reference(), engine=engine)


def test_levels_of_the_compiler():
    with pytest.raises(ConfigurationError, match="optimise must be 0, 1, 2 or 3, got 4"):
        CEngine(optimise=4)


def test_another_gain_is_not_compiled_anew_and_a_damaged_library_is(
    monkeypatch, tmp_path, tmp_path_factory
):
    machine, reference = velocity_stage(), line_reference(n=20)
    compiled = []
    original = library_cache._compile

    def counted(*arguments):
        compiled.append(arguments)
        return original(*arguments)

    monkeypatch.setattr(library_cache, "_compile", counted)

    def run(k, folder):
        return cl.simulate(
            machine, Proportional(k=k), reference, engine=CEngine(optimise=0, folder=folder)
        )

    slow, fast = run(20.0, tmp_path), run(40.0, tmp_path)
    c_engine._sources.clear()  # as in another process
    again = run(20.0, tmp_path)
    assert len(compiled) == 1
    assert np.max(np.abs(fast["command"].values)) > np.max(np.abs(slow["command"].values))
    assert_array_equal(again["command"], slow["command"])
    (library,) = tmp_path.iterdir()
    other = tmp_path_factory.mktemp("damaged")
    shutil.copy(library, other / library.name)
    (other / library.name).write_bytes(library.read_bytes()[:100])
    assert_array_equal(run(20.0, other)["command"], slow["command"])
    assert len(compiled) == 2
    full = tmp_path / "file"
    full.write_text("")
    with pytest.raises(cl.errors.OutputError, match=r"cannot be kept in .*XDG_CACHE_HOME"):
        run(20.0, full)


def test_comparisons_take_an_engine(engine):
    laws = [Proportional(k=20.0), Proportional(k=40.0)]
    found = cl.compare(velocity_stage(), laws, line_reference(n=50), engine=engine)
    assert {one.dataset.attrs["engine"] for one in found.recordings.values()} == {"c"}
