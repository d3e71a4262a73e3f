"""What an encoder sees of a drive that bends, plays and is not true, and where the tool is."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.configuration import replace
from contourlab.errors import ConfigurationError
from contourlab.machines import (
    Drive,
    Encoder,
    Friction,
    GeometricErrors,
    LinearTool,
    Machine,
    PositionError,
    RigidAxes,
    Squareness,
    TwoMassAxes,
)

T = 1e-3


def rigid(errors=None, n_axes=2, **parts):
    return Machine(
        names=("X", "Y", "Z")[:n_axes], dynamics=RigidAxes(mass=1.0), errors=errors,
        drive=Drive(command="force"), **parts,
    )  # fmt: skip


SCREW = PositionError(scale=2e-5, amplitude=3e-6, period=0.01, phase=0.5)
SCALE = PositionError(scale=(1e-5, -3e-5), amplitude=(1e-7, 2e-7), period=2e-5)
AT = np.array((0.1234, -0.0457))


def screw(q):
    return 2e-5 * q + 3e-6 * np.sin(2 * math.pi * q / 0.01 + 0.5)


def scale(y):
    cyclic = np.array((1e-7, 2e-7)) * np.sin(2 * math.pi * y / 2e-5)
    return np.array((1e-5, -3e-5)) * y + cyclic


def test_on_the_motor_the_screw_is_not_seen():
    errors = GeometricErrors(screw=SCREW, scale=SCALE)
    bound = rigid(errors, sensor=Encoder(side="motor")).bind(T)
    state = bound.init(AT)
    assert_allclose(bound.measure(state).position, AT, rtol=0, atol=0)
    assert_allclose(bound.true_position(state), AT + screw(AT), rtol=0, atol=1e-16)


def test_a_scale_sees_the_screw_and_not_itself():
    errors = GeometricErrors(screw=SCREW, scale=SCALE)
    bound = rigid(errors).bind(T)
    state = bound.init(AT)
    assert_allclose(bound.measure(state).position, AT, rtol=0, atol=1e-16)
    table = np.asarray(bound.true_position(state))
    assert_allclose(table - scale(table), AT, rtol=0, atol=1e-16)
    assert np.all(np.abs(table - AT) > 1e-6)
    without = rigid(GeometricErrors(screw=SCREW)).bind(T)
    assert_allclose(without.true_position(without.init(AT)), AT, rtol=0, atol=1e-16)


def test_sides_may_differ_from_axis_to_axis():
    errors = GeometricErrors(screw=SCREW)
    bound = rigid(errors, sensor=Encoder(side=("motor", "tool"))).bind(T)
    state = bound.init(AT)
    assert_allclose(bound.measure(state).position, AT, rtol=0, atol=1e-16)
    off = np.asarray(bound.true_position(state)) - AT
    assert_allclose(off, (screw(AT)[0], 0.0), rtol=0, atol=1e-16)


def test_squareness_tilts_the_second_axis():
    errors = GeometricErrors(
        squareness=(
            Squareness(axes=("X", "Y"), angle=1e-4),
            Squareness(axes=("Z", "Y"), angle=-2e-4),
        )
    )
    bound = rigid(errors, 3).bind(T)
    moved = bound.true_position(bound.init(np.array((0.0, 0.2, 0.0))))
    assert_allclose(moved, (-0.2e-4, 0.2, 0.4e-4), rtol=1e-14)
    # the angle between +X and +Y is a right one and α
    along = np.asarray(moved)[:2] / np.linalg.norm(np.asarray(moved)[:2])
    assert_allclose(math.acos(along[0]) - math.pi / 2, 1e-4, rtol=1e-6)
    assert np.array_equal(
        bound.measure(bound.init(np.array((0.0, 0.2, 0.0)))).position, (0, 0.2, 0)
    )


def test_the_tool_map_stands_on_the_true_axes():
    errors = GeometricErrors(screw=SCREW)
    tool = LinearTool(matrix=np.array(((1.0, 1.0),)))
    bound = rigid(errors, tool=tool, sensor=Encoder(side="motor")).bind(T)
    assert_allclose(bound.tool_position(bound.init(AT)), np.sum(AT + screw(AT)), rtol=1e-15)


def test_true_and_ideal_velocities_are_derivatives():
    errors = GeometricErrors(
        screw=SCREW, scale=SCALE, squareness=(Squareness(axes=("X", "Y"), angle=1e-3),)
    )
    m = rigid(errors, sensor=Encoder(velocity="ideal"))
    bound = m.bind(1e-7)
    before = bound.init(AT, velocity=jnp.array((0.3, -0.2)))
    after = bound.advance(before, jnp.zeros(2), jnp.zeros(2))
    for value, rate in (
        (bound.true_position, bound.true_velocity),
        (bound.shown_position, lambda s: bound.measure(s).velocity),
    ):
        slope = (np.asarray(value(after)) - np.asarray(value(before))) / 1e-7
        assert_allclose(rate(after), slope, rtol=1e-4)


def slow_triangle(machine, *, turn=2000, reach=2e-4):
    """Move the motors out and back, slowly, by a stiff position loop of our own."""
    bound = machine.bind(T)
    wanted = reach * np.concatenate([np.linspace(0, 1, turn), np.linspace(1, 0, turn)])[:, None]

    def step(carry, r):
        state, integral = carry
        seen = bound.measure(state)
        error = r - seen.position
        integral = integral + 2e5 * T * error
        command = 4e4 * error - 400.0 * seen.velocity + integral
        state = bound.advance(state, command, jnp.zeros(1))
        out = (seen.position, bound.true_position(state), bound.dynamics.motor_position(state.axes))
        return (state, integral), out

    start = bound.init(jnp.zeros(1)), jnp.zeros(1)
    return [np.asarray(x)[:, 0] for x in jax.jit(lambda: jax.lax.scan(step, start, wanted))()[1]]


BACKLASH = 20e-6
PAIR = TwoMassAxes(
    motor_mass=4.0, load_mass=10.0, stiffness=5e7, damping=800.0, motor_viscous=50.0,
    load_friction=Friction(coulomb=2.0, smoothing_velocity=1e-5), backlash=BACKLASH,
)  # fmt: skip


def stage(side, **sensor):
    return Machine(
        names=("X",), dynamics=PAIR, drive=Drive(command="force"),
        sensor=Encoder(side=side, velocity="ideal", **sensor),
    )  # fmt: skip


def test_a_reversal_loses_the_backlash_at_the_table_and_the_motor_does_not_know():
    seen, table, motor = slow_triangle(stage("motor"))
    out, back = 1000, 3000  # forwards and backwards
    bend = 2.0 / 5e7  # what friction bends the spring by, each way
    assert_allclose(motor[out] - table[out], BACKLASH / 2 + bend, rtol=2e-2)
    assert_allclose(motor[back] - table[back], -BACKLASH / 2 - bend, rtol=2e-2)
    assert_allclose(seen[1:], motor[:-1], rtol=0, atol=0)  # it is the motor that is shown
    crossing = np.flatnonzero(np.abs(motor - table)[1990:] < 0.45 * BACKLASH) + 1990
    still = table[crossing[crossing < 2600]]
    assert len(still) > 50
    assert np.ptp(still) < 0.1 * BACKLASH, "while the motor crosses the gap the table stands"


def test_a_scale_sees_the_lost_motion():
    seen, table, motor = slow_triangle(stage("tool", velocity_side="motor"))
    assert motor[1000] - table[1000] > 0.49 * BACKLASH
    assert motor[3000] - table[3000] < -0.49 * BACKLASH
    # the loop closes over the table: half the backlash of a motor-side loop would be 10 µm
    # (the slow loop is still 2 to 3 µm behind from the reversal)
    assert_allclose(table[1000], 1e-4, rtol=0, atol=4e-6)
    assert_allclose(table[3000], 1e-4, rtol=0, atol=4e-6)
    assert_allclose(seen[1:], table[:-1], rtol=0, atol=1e-16)


def test_velocity_may_come_from_the_other_side():
    commands = 30.0 * np.sin(np.arange(60) / 2.0)
    read = {}
    for side, velocity_side in (("tool", None), ("tool", "motor"), ("motor", None)):
        sensor = Encoder(resolution=1e-9, side=side, velocity_side=velocity_side)
        bound = Machine(
            names=("X",), dynamics=PAIR, drive=Drive(command="force"), sensor=sensor
        ).bind(T)  # fmt: skip
        state, rows = bound.init(jnp.zeros(1)), []
        advance = jax.jit(lambda s, u, bound=bound: bound.advance(s, u, jnp.zeros(1)))
        for command in commands:
            state = advance(state, jnp.full(1, command))
            seen = bound.measure(state)
            rows.append((float(seen.position[0]), float(seen.velocity[0])))
        read[side, velocity_side] = np.array(rows)
    mixed = read["tool", "motor"]
    assert np.array_equal(mixed[:, 0], read["tool", None][:, 0])
    assert np.array_equal(mixed[:, 1], read["motor", None][:, 1])
    assert np.max(np.abs(mixed[:, 1] - read["tool", None][:, 1])) > 1e-3


def test_both_sides_of_a_noisy_machine_have_their_own_noise():
    sensor = Encoder(noise=1e-6, side="tool", velocity_side="motor")
    bound = Machine(
        names=("X",), dynamics=PAIR, drive=Drive(command="force"), sensor=sensor
    ).bind(T)  # fmt: skip
    state = bound.init(jnp.zeros(1), 3)
    assert float(state.other[0]) != float(state.measurement.position[0])


def test_laws_know_nothing_of_geometric_errors():
    from contourlab.contour_errors import TangentEstimator
    from contourlab.contours import Line
    from contourlab.controllers import AxisPid, CrossCoupled
    from contourlab.feedrate import constant_feed
    from contourlab.simulation.checks import check_loop

    errors = GeometricErrors(squareness=(Squareness(axes=("X", "Y"), angle=1e-3),))
    m = replace(rigid(errors), dynamics=RigidAxes(mass=1.0, viscous=5.0))
    axis = AxisPid.by_pole_placement(m.nominal, bandwidth_hz=10.0)
    law = CrossCoupled(axis=axis, estimator=TangentEstimator(), kp=1.0)
    path = constant_feed(Line(start=(0.0, 0.0), end=(0.1, 0.1)), feed=0.1, sample_time=T)
    check_loop(m, law, path)  # refused if the errors were part of the tool map


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Encoder(side="table"), "unknown side 'table'.*motor, tool"),
        (lambda: Encoder(velocity_side="table"), "unknown velocity_side 'table'"),
        (
            lambda: rigid(sensor=Encoder(side=("motor",) * 3)),
            "side must have one value per axis, 2",
        ),
        (lambda: Squareness(axes=("X", "X"), angle=0.0), "two different axes"),
        (lambda: Squareness(axes=("X", "Y"), angle=0.5), "angle must be < 0.1 rad"),
        (lambda: PositionError(scale=0.5), "an error and not a gear, got 0.5"),
        (lambda: PositionError(amplitude=1e-3, period=1e-3), "an error and not a gear"),
        (
            lambda: rigid(GeometricErrors(squareness=(Squareness(axes=("X", "A"), angle=0.0),))),
            "no axis 'A'; Allowed: X, Y",
        ),
        (
            lambda: rigid(
                GeometricErrors(
                    squareness=(
                        Squareness(axes=("X", "Y"), angle=0.0),
                        Squareness(axes=("Y", "X"), angle=0.0),
                    )
                )
            ),
            "given twice",
        ),
        (
            lambda: rigid(GeometricErrors(screw=PositionError(scale=(0.0,) * 3))),
            "errors.screw.scale must have one value per axis, 2, got 3",
        ),
    ],
    ids=range(10),
)
def test_what_does_not_fit_is_named(make, words):
    with pytest.raises(ConfigurationError, match=words):
        make()
