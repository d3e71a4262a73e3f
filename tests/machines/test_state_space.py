"""Identified state spaces, and systems of python-control both ways."""

import inspect
import math
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

from contourlab.configuration import replace_at
from contourlab.errors import ConfigurationError
from contourlab.machines import (
    BallScrewAxes,
    Drive,
    Machine,
    RigidAxes,
    StateSpaceAxes,
    TransferFunctionAxes,
    TwoMassAxes,
    from_control,
    iron_core_stage,
    to_control,
)

control = pytest.importorskip("control", reason="python-control is an optional extra")
T = 1e-3
LAG = 0.012
CONTINUOUS = {
    "state_matrix": ((0.0, 1.0), (0.0, -1.0 / LAG)),
    "input_matrix": ((0.0,), (1.0 / LAG,)),
    "output_matrix": ((1.0, 0.0),),
}
DECAY = math.exp(-T / LAG)
DISCRETE = {
    "state_matrix": ((1.0, LAG * (1 - DECAY)), (0.0, DECAY)),
    "input_matrix": ((T - LAG * (1 - DECAY),), (1 - DECAY,)),
    "output_matrix": ((1.0, 0.0),),
    "sample_time": T,
}
CROSS = {
    "state_matrix": ((0.9, 0.01), (0.02, 0.85)), "input_matrix": ((0.1, 0.0), (0.0, 0.15)),
    "output_matrix": ((1.0, 0.0), (0.03, 1.0)),
}  # fmt: skip


def machine(dynamics, n_axes=1, **parts):
    drive = parts.pop("drive", Drive(command="velocity"))
    return Machine(names=("X", "Y", "Z")[:n_axes], dynamics=dynamics, drive=drive, **parts)


@jax.jit
def advance(bound, state, command):
    """Compiled once for a kind of machine: a step run piece by piece takes tens of ms."""
    return bound.advance(state, command, jnp.zeros(len(command)))


def run(m, commands, sample_time=T):
    bound = m.bind(sample_time)
    state, seen = bound.init(jnp.zeros(m.n_axes)), []
    for command in np.reshape(commands, (-1, m.n_axes)):
        state = advance(bound, state, jnp.asarray(command))
        seen.append(np.concatenate([bound.true_position(state), bound.true_velocity(state)]))
    return np.array(seen)


COMMANDS = np.sin(np.arange(30) / 4.0) + 0.3


def test_a_first_order_drive_by_every_road():
    by_function = TransferFunctionAxes(numerators=((1.0,),), denominators=((LAG, 1.0, 0.0),))
    expected = run(machine(by_function), COMMANDS)
    assert_allclose(run(machine(StateSpaceAxes(**CONTINUOUS)), COMMANDS), expected, rtol=1e-12)
    position = run(machine(StateSpaceAxes(**DISCRETE)), COMMANDS)[:, 0]
    assert_allclose(position, expected[:, 0], rtol=1e-12)
    again = StateSpaceAxes(**DISCRETE).continuous()
    assert_allclose(run(machine(again), COMMANDS), expected, rtol=1e-9)
    assert_allclose(
        run(machine(again), COMMANDS, T / 3), run(machine(by_function), COMMANDS, T / 3), rtol=1e-9
    )


def test_discrete_positions_are_those_of_the_recursion():
    a, b, c = (np.array(DISCRETE[k]) for k in ("state_matrix", "input_matrix", "output_matrix"))
    x, expected = np.zeros(2), []
    for u in COMMANDS:
        x = a @ x + b[:, 0] * u
        expected.append(c[0] @ x)
    assert_allclose(run(machine(StateSpaceAxes(**DISCRETE)), COMMANDS)[:, 0], expected, rtol=1e-13)


def test_velocities_are_integrated_by_the_trapezoidal_rule():
    axes = StateSpaceAxes(**CROSS, sample_time=T, output="velocity")
    a, b, c = (np.array(CROSS[k]) for k in ("state_matrix", "input_matrix", "output_matrix"))
    commands = np.stack([COMMANDS, -COMMANDS[::-1]], -1)
    x, q, seen = np.zeros(2), np.zeros(2), run(machine(axes, 2), commands)
    for k, u in enumerate(commands):
        after = a @ x + b @ u
        q = q + T * (c @ x + c @ after) / 2
        x = after
        assert_allclose(seen[k], np.concatenate([q, c @ x]), rtol=1e-12, atol=1e-15)


def test_a_continuous_velocity_is_integrated_exactly_with_its_direct_part():
    lead = StateSpaceAxes(
        state_matrix=((-50.0,),), input_matrix=((30.0,),), output_matrix=((1.0,),),
        direct_matrix=((0.4,),), output="velocity",
    )  # fmt: skip
    seen = run(machine(lead), np.ones(100))
    t = T * np.arange(1, 101)
    rise = 0.6 * (1 - np.exp(-50.0 * t))
    assert_allclose(seen[:, 1], rise + 0.4, rtol=1e-12)
    assert_allclose(seen[:, 0], t - 0.6 * (1 - np.exp(-50.0 * t)) / 50.0, rtol=1e-11)


@pytest.mark.parametrize(
    "axes",
    [
        StateSpaceAxes(**CONTINUOUS), StateSpaceAxes(**DISCRETE),
        StateSpaceAxes(**CROSS, sample_time=T, output="velocity"),
    ],
    ids=["continuous", "discrete", "cross-talk"],
)  # fmt: skip
def test_steady_motion_goes_on(axes):
    n = axes.n_axes
    bound = machine(axes, n).bind(T)
    speed, at = jnp.array((0.3, -0.1))[:n], jnp.array((0.2, 0.7))[:n]
    state, command = bound.dynamics.steady(at, speed)
    for k in range(1, 20):
        state = bound.dynamics.advance(state, (command,), jnp.zeros(n))
        assert_allclose(bound.dynamics.position(state), at + k * T * speed, rtol=1e-11)
        assert_allclose(bound.dynamics.velocity(state), speed, rtol=1e-9)


def test_the_nominal_model_is_that_at_low_frequency():
    for axes in (StateSpaceAxes(**CONTINUOUS), StateSpaceAxes(**DISCRETE)):
        told = machine(axes).nominal
        assert_allclose(told.mass / told.gain, LAG, rtol=1e-9)
        assert_allclose(told.viscous / told.gain, 1.0, rtol=1e-9)
    double = from_control(control.tf([1.0], [5.0, 0.0, 0.0]))
    told = machine(double, drive=Drive(command="force")).nominal
    assert_allclose(told.mass / told.gain, 5.0, rtol=1e-9)
    assert_allclose(told.viscous, 0.0, atol=1e-9)
    servo = from_control(control.tf([1.0], [0.01, 1.0]))
    with pytest.raises(ConfigurationError, match="has no integrator; give the machine a nominal"):
        machine(servo).nominal  # noqa: B018


def changed(**values):
    return StateSpaceAxes(**(DISCRETE | values))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: changed(state_matrix=((1.1, 0.0), (0.0, 0.9))), "unstable.*unit circle.*got 1.1"),
        (
            lambda: StateSpaceAxes(**(CONTINUOUS | {"state_matrix": ((0.0, 1.0), (0.0, 2.0))})),
            "unstable.*imaginary axis.*got 2",
        ),
        (lambda: changed(direct_matrix=((0.1,),)), "a position does not jump"),
        (
            lambda: changed(output_matrix=((1.0, 0.0, 0.0),)),
            r"output_matrix must have shape \(1, 2\)",
        ),
        (lambda: changed(output_matrix=((1.0, 0.0), (0.0, 1.0))), "one command per axis"),
        (
            lambda: changed(state_matrix=((math.nan, 0.0), (0.0, 1.0))),
            "state_matrix must be finite",
        ),
        (lambda: changed(sample_time=-1.0), "sample_time must be > 0 s, got -1"),
        (lambda: changed(input_matrix=((0.0,), (0.0,))), "cannot be brought to a position"),
        (lambda: machine(changed(), 2), "one column per axis, 2, got 1"),
        (lambda: machine(changed()).bind(2e-3), "identified at 0.001 s and the control period is"),
        (
            lambda: replace_at(machine(changed()), "drive.computing_delay", 4e-4).bind(T),
            "computing delay cuts the control period",
        ),
        (lambda: changed(state_matrix=((1.0, 1.0), (0.0, 0.0))).continuous(), "a pole at zero is"),
        (
            lambda: changed(state_matrix=((1.0, 1.0), (0.0, -0.5))).continuous(),
            "negative real axis",
        ),
        (
            lambda: StateSpaceAxes.per_axis([changed(), StateSpaceAxes(**CONTINUOUS)]),
            "one sample_time",
        ),
        (lambda: StateSpaceAxes.per_axis([]), "got none"),
    ],
    ids=range(15),
)
def test_what_cannot_be_is_said(make, words):
    with pytest.raises(ConfigurationError, match=words):
        make()


def test_whole_periods_of_delay_suit_a_discrete_model():
    now = run(machine(changed()), COMMANDS)
    late = replace_at(machine(changed()), "drive.computing_delay", 2 * T)
    assert_allclose(run(late, COMMANDS)[2:], now[:-2], rtol=1e-13)


SYSTEMS = {
    "tf": control.tf([3.0, 40.0], [0.001, 0.2, 1.0, 0.0]),
    "tf, discrete": control.tf([0.01, 0.02], [1.0, -1.8, 0.8], T),
    "ss": control.ss([[0, 1], [0, -20.0]], [[0], [5.0]], [[1, 0]], 0),
    "mimo tf": control.tf(
        [[[1.0], [0.02]], [[0.0], [2.0]]],
        [[[0.01, 1.0, 0.0], [0.01, 1.0]], [[1.0], [0.02, 1.0, 0.0]]],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SYSTEMS)
def test_systems_there_and_back_have_one_frequency_response(name):
    system = SYSTEMS[name]
    m = machine(from_control(system), system.ninputs)
    back = to_control(m)
    omega = np.logspace(-1, 3, 30)
    wanted, got = control.frequency_response(system, omega), control.frequency_response(back, omega)
    assert_allclose(got.complex, wanted.complex, rtol=1e-9, atol=1e-12)
    assert (back.dt or 0) == (system.dt or 0)
    assert back.input_labels[0] == "command X"


def test_one_system_per_axis():
    axes = from_control([SYSTEMS["ss"], control.ss(SYSTEMS["tf"])])
    m = machine(axes, 2)
    omega = np.array((1.0, 10.0, 100.0))
    for axis, name in (("X", "ss"), ("Y", "tf")):
        got = control.frequency_response(to_control(m, axis=axis), omega)
        assert_allclose(
            got.complex, control.frequency_response(SYSTEMS[name], omega).complex, rtol=1e-9
        )


DYNAMICS = {
    "rigid": RigidAxes(mass=(2.0, 5.0), viscous=(3.0, 0.0), gain=4.0),
    "two-mass": TwoMassAxes(motor_mass=2.0, load_mass=(5.0, 9.0), stiffness=1e5, damping=20.0),
    "ball screw": BallScrewAxes(lead=0.01, motor_inertia=1e-3, table_mass=(50.0, 80.0)),
    "transfer": TransferFunctionAxes(
        numerators=((1.0,), (2.0, 3.0)), denominators=((LAG, 1.0, 0.0), (1e-4, 0.02, 1.0, 0.0))
    ),
    "state space": StateSpaceAxes(**CROSS, sample_time=T, output="velocity"),
}


@pytest.mark.parametrize("delay", [0.0, 1.0, 2.4])
@pytest.mark.parametrize("name", DYNAMICS)
def test_the_discrete_system_answers_like_the_machine(name, delay):
    """Delay included: the loop's own plant, by SciPy's exponential and by ours."""
    if name == "state space" and delay == 2.4:
        pytest.skip("a discrete model takes whole periods of delay only")
    drive = Drive(command="velocity", computing_delay=delay * T)
    m = machine(DYNAMICS[name], 2, drive=drive)
    system = to_control(m, sample_time=T)
    rng = np.random.default_rng(5)
    commands = rng.normal(size=(20, 2))
    made = run(m, commands)[:, :2]
    answer = control.forced_response(system, T * np.arange(21), np.append(commands, [[0, 0]], 0).T)
    assert_allclose(made, answer.outputs.T[1:], rtol=1e-9, atol=1e-12 * np.max(np.abs(made)))
    # the continuous one, held, is the same without the delay
    if delay == 0.0 and name != "state space":
        held = control.c2d(to_control(m), T)
        assert_allclose(expm(to_control(m).A * T), held.A, rtol=1e-9, atol=1e-12)


def test_the_motor_side_has_the_anti_resonance():
    m = iron_core_stage()
    omega = 2 * math.pi * np.linspace(60.0, 90.0, 1501)
    axis = to_control(m, axis="X", side="motor")
    dip = omega[np.argmin(np.abs(axis(1j * omega)))] / 2 / math.pi
    rate = 2 * math.pi * np.linspace(80.0, 110.0, 3001)
    dip = rate[np.argmin(np.abs(axis(1j * rate)))] / 2 / math.pi
    assert_allclose(dip, m.dynamics.anti_resonance_hz[0], rtol=5e-3)


def test_wrong_systems_are_named(monkeypatch):
    with pytest.raises(
        ConfigurationError, match=r"must be a TransferFunction or StateSpace .* int"
    ):
        from_control(3)
    for systems in ("abc", b"abc", ["abc"], [[SYSTEMS["tf"]]]):
        with pytest.raises(ConfigurationError, match=r"TransferFunction or StateSpace .* got"):
            from_control(systems)
    words = "one input and one output each, got 2 and 2 at position 1"
    with pytest.raises(ConfigurationError, match=words):
        from_control([SYSTEMS["tf"], SYSTEMS["mimo tf"]])
    with pytest.raises(ConfigurationError, match="dt is True"):
        from_control(control.tf([1.0], [1.0, -1.0], True))
    with pytest.raises(ConfigurationError, match="improper"):
        from_control(control.tf([1.0, 0.0, 0.0], [1.0, 0.0]))
    m = machine(StateSpaceAxes(**DISCRETE))
    with pytest.raises(ConfigurationError, match="no axis 'A'"):
        to_control(m, axis="A")
    with pytest.raises(ConfigurationError, match="unknown side 'table'"):
        to_control(m, side="table")
    with pytest.raises(ConfigurationError, match=r"identified at 0.001 s .* got 0.002 s"):
        to_control(m, sample_time=2e-3)
    for period in (-1.0, 0.0, math.nan, math.inf):
        with pytest.raises(ConfigurationError, match="sample_time must be > 0 s, got"):
            to_control(m, sample_time=period)
    untyped = inspect.unwrap(to_control)  # as outside tests, where no annotation is checked
    for period in ("1 ms", "0.001", True, [T]):
        with pytest.raises(ConfigurationError, match="sample_time must be > 0 s, got"):
            untyped(m, sample_time=period)
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(ConfigurationError, match=r"optional extra control.*contourlab\[control\]"):
        from_control(3)
