"""Conformance of a machine: what the loop relies on, whatever the axes are.

The machine is put at the middle of its travel and given small commands, so that it stays within
it. Tolerances are relative to the motion that a command causes.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import replace, replace_at
from contourlab.machines.base import NominalModel
from contourlab.machines.machine import BoundMachine, Machine
from contourlab.testing.protocol import check_frozen, float_leaves
from contourlab.typing import Array, AxisVector, Record

__all__ = ["check_machine"]

N_STEPS = 25
KEY = 7


def check_machine(machine: Machine, *, sample_time: float = 1e-3) -> None:
    """Assert that a machine keeps the contract of machines.

    Shapes and types, purity, tracing, batches, derivatives against finite differences, rest without
    drift, delay, saturation, the grid of the encoder and its derivative, and reproducible noise.

    Parameters
    ----------
    machine
        Any machine.
    sample_time
        Time between samples [s].
    """
    check_frozen(machine)
    _check_nominal(machine)
    bound = machine.bind(sample_time)
    _check_shapes(machine, bound)
    _check_pure(machine, bound)
    _check_rest(machine, bound)
    _check_batch(machine, sample_time)
    _check_derivatives(machine, sample_time)
    _check_delay(machine, sample_time)
    _check_saturation(machine, bound)
    _check_encoder(machine, sample_time)
    _check_noise(machine, sample_time)


def _middle(machine: Machine) -> Array:
    ends = np.broadcast_to(np.asarray(machine.travel, float), (machine.n_axes, 2))
    return np.where(np.isfinite(ends).all(-1), np.where(np.isfinite(ends), ends, 0).mean(-1), 0.0)


def _rest_command(machine: Machine, bound: BoundMachine) -> AxisVector:
    command: AxisVector = _rest(bound, jnp.asarray(_middle(machine)))[0]
    return command


def _commands(machine: Machine, bound: BoundMachine) -> Record:
    """A wave about the command of rest, at a third of the limit or, without one, for 0.1 m/s²."""
    nominal = machine.nominal
    speed, change = np.full(machine.n_axes, 1e-2), np.full(machine.n_axes, 0.1)
    wanted = np.asarray(nominal.feed_forward(speed, change))
    wanted = wanted + np.asarray(nominal.coulomb) / np.asarray(nominal.gain)
    limit = np.broadcast_to(np.asarray(machine.drive.command_limit), (machine.n_axes,))
    size = np.minimum(wanted, 0.3 * limit)
    phase = np.arange(N_STEPS)[:, None] / 4.0 + np.arange(machine.n_axes) + 1.0
    wave: Array = np.asarray(_rest_command(machine, bound)) + size * np.sin(phase)
    return wave


def _run(bound: BoundMachine, position: Any, commands: Any, key: Any = KEY) -> tuple[Any, ...]:
    """Return true positions, measured ones and those of ideal encoders after each step."""
    return _steps(bound, jnp.asarray(position), jnp.asarray(commands), jnp.asarray(key))  # type: ignore[no-any-return]


@jax.jit
def _rest(bound: BoundMachine, position: Array) -> tuple[AxisVector, AxisVector, AxisVector]:
    """Return the command of rest, and where the axes then are: shown and in truth."""
    state = bound.init(position, KEY)
    command = bound.dynamics.steady(position, jnp.zeros(bound.n_axes))[1]
    return command, bound.shown_position(state), bound.true_position(state)


@jax.jit
def _compiled_init(bound: BoundMachine, position: Array) -> Any:
    return bound.init(position, KEY)


@jax.jit
def _steps(bound: BoundMachine, position: Array, commands: Array, key: Array) -> tuple[Any, ...]:
    def step(state: Any, command: Any) -> tuple[Any, Any]:
        state = bound.advance(state, command, jnp.zeros(bound.n_axes))
        seen = bound.true_position(state), bound.measure(state).position
        return state, (*seen, bound.shown_position(state))

    return jax.lax.scan(step, bound.init(position, key), commands)[1]  # type: ignore[no-any-return]


def _check_nominal(machine: Machine) -> None:
    nominal = machine.nominal
    assert isinstance(nominal, NominalModel), f"nominal must be a NominalModel, got {nominal!r}"
    assert nominal.n_axes == machine.n_axes, (
        f"nominal is for {nominal.n_axes} axes, the machine has {machine.n_axes}"
    )
    assert nominal.command == machine.command, (
        f"nominal takes {nominal.command}, the machine {machine.command}"
    )


def _check_shapes(machine: Machine, bound: BoundMachine) -> None:
    position = jnp.asarray(_middle(machine))
    # shapes and types are known when it is traced: nothing is compiled
    jax.eval_shape(lambda position: _check_types(machine, bound, position), position)
    _, shown, true = _rest(bound, position)
    np.testing.assert_allclose(  # a realisation is solved for this position: rounding
        shown, position, rtol=0, atol=1e-12, err_msg="init is elsewhere"
    )
    if machine.errors is None:
        np.testing.assert_allclose(
            true, position, rtol=0, atol=1e-12,
            err_msg="without geometric errors the true position at rest is the one shown",
        )  # fmt: skip


def _check_types(machine: Machine, bound: BoundMachine, position: Any) -> None:
    n_axes = machine.n_axes
    before = bound.init(position, KEY)
    after = bound.advance(before, jnp.zeros(n_axes), jnp.zeros(n_axes))
    old: Any = jax.tree.structure(before)
    new: Any = jax.tree.structure(after)
    assert old == new, f"advance changes the structure of the state: {old} became {new}"
    for (path, a), b in zip(
        jax.tree_util.tree_leaves_with_path(before), jax.tree.leaves(after), strict=True
    ):
        where = f"state{jax.tree_util.keystr(path)}"
        assert jnp.shape(a) == jnp.shape(b), f"{where}: {jnp.shape(a)} became {jnp.shape(b)}"
        assert a.dtype == b.dtype, f"{where}: {a.dtype} became {b.dtype}"
    for state in (before, after):
        seen = bound.measure(state)
        for name, value in (
            ("measured position", seen.position),
            ("measured velocity", seen.velocity),
            ("shown_position", bound.shown_position(state)),
            ("true_position", bound.true_position(state)),
            ("true_velocity", bound.true_velocity(state)),
        ):
            assert value.shape == (n_axes,), (
                f"{name} must have shape ({n_axes},), got {value.shape}"
            )
            assert value.dtype == np.float64, f"{name} must be float64, got {value.dtype}"
        tool, n_coordinates = bound.tool_position(state), machine.tool.n_coordinates or n_axes
        assert tool.shape == (n_coordinates,), (
            f"tool_position must have shape ({n_coordinates},), got {tool.shape}"
        )


def _check_pure(machine: Machine, bound: BoundMachine) -> None:
    state = _compiled_init(bound, _middle(machine))
    command, quiet = jnp.asarray(_commands(machine, bound)[0]), jnp.zeros(machine.n_axes)
    held = [np.array(leaf) for leaf in jax.tree.leaves((bound, state))]

    def traced_anew() -> Any:  # what Python remembers shows itself
        return jax.jit(lambda bound, *given: bound.advance(*given))(bound, state, command, quiet)

    once, twice = (jax.tree.leaves(traced_anew()) for _ in range(2))
    for a, b in zip(once, twice, strict=True):
        assert np.array_equal(a, b), "advance gives two answers to one input"
    # with the machine's own arrays, which could be written to
    jax.eval_shape(lambda: bound.advance(state, command, quiet))
    for leaf, kept in zip(jax.tree.leaves((bound, state)), held, strict=True):
        assert np.array_equal(leaf, kept), "advance changes what it is given"


def _check_rest(machine: Machine, bound: BoundMachine) -> None:
    position = _middle(machine)
    commands = np.broadcast_to(_rest_command(machine, bound), (N_STEPS, machine.n_axes))
    start = np.asarray(_rest(bound, jnp.asarray(position))[2])
    there = np.asarray(_run(bound, position, commands)[0])
    drift = np.max(np.abs(there - start))
    assert drift < 1e-12, f"at rest, without a command, the axes drift by {drift:g} m"


def _check_batch(machine: Machine, sample_time: float) -> None:
    bound, position = machine.bind(sample_time), _middle(machine)
    commands = _commands(machine, bound)
    alone = np.asarray(_run(bound, position, commands)[0])
    leaves, rebuild = float_leaves(machine.dynamics)
    pair = [np.stack([leaf, leaf]) for _, leaf in leaves]

    def one(values: Any) -> Any:
        changed = _with_dynamics(machine, rebuild(values))
        return _run(changed.bind(sample_time), position, commands)[0]

    both = np.asarray(jax.jit(jax.vmap(one))(pair))
    scale = np.max(np.abs(alone - alone[0])) + 1e-9
    for lane in both:  # another order of sums: rounding of the position itself
        np.testing.assert_allclose(
            lane, alone, rtol=0, atol=1e-9 * scale + 1e-14, err_msg="vmap over the dynamics"
        )


def _with_dynamics(machine: Machine, dynamics: Any) -> Machine:
    return replace(machine, dynamics=dynamics)


def _check_derivatives(machine: Machine, sample_time: float) -> None:
    """Relative changes of every number of the dynamics and of the commands, all at once."""
    bound, position = machine.bind(sample_time), _middle(machine)
    commands = jnp.asarray(_commands(machine, bound))
    leaves, rebuild = float_leaves(machine.dynamics)
    values = [jnp.asarray(leaf) for _, leaf in leaves]
    weights = 1.0 + jnp.arange(machine.n_axes)

    def moved(values: Any, commands: Any) -> Any:
        bound = _with_dynamics(machine, rebuild(values)).bind(sample_time)
        return jnp.sum(weights * (_run(bound, position, commands)[0][-1] - position))

    signs = [1.0 if k % 2 else -1.0 for k in range(len(values))]
    point = (values, commands)
    along = ([s * v for s, v in zip(signs, values, strict=True)], 0.5 * commands)
    # one compilation serves the finite differences and the forward derivative
    with_slope = jax.jit(lambda point: jax.jvp(moved, point, along))

    def shifted(step: float) -> float:
        return float(with_slope(jax.tree.map(lambda x, d: x + step * d, point, along))[0])

    step = 1e-5
    slope = (shifted(step) - shifted(-step)) / (2.0 * step)
    value, forward = with_slope(point)
    gradient = jax.jit(jax.grad(moved, argnums=(0, 1)))(*point)
    pairs = zip(jax.tree.leaves(gradient), jax.tree.leaves(along), strict=True)
    backward = sum(float(jnp.vdot(g, d)) for g, d in pairs)
    scale = abs(float(slope)) + abs(float(value))
    for name, derivative in (("forward", forward), ("reverse", backward)):
        error = abs(float(derivative) - slope)  # central differences: 1e-10 of truncation, rounding
        assert error <= 1e-4 * scale, (
            f"{name}-mode derivative is {float(derivative):g}, finite differences say {slope:g}"
        )


def _check_delay(machine: Machine, sample_time: float) -> None:
    position = _middle(machine)
    longer = machine.drive.computing_delay + 2.0 * sample_time
    late = replace_at(machine, "drive.computing_delay", longer)
    commands = _commands(machine, machine.bind(sample_time))
    now = np.asarray(_run(machine.bind(sample_time), position, commands)[0])
    waits = late.bind(sample_time)
    start = np.asarray(_rest(waits, jnp.asarray(position))[2])
    then = np.asarray(_run(waits, position, commands)[0])
    scale = np.max(np.abs(now - start)) + 1e-9
    waiting = np.max(np.abs(then[:2] - start))
    assert waiting <= 1e-9 * scale, "a delay of two samples: the axes move before it is over"
    np.testing.assert_allclose(
        then[2:], now[:-2], rtol=0, atol=1e-9 * scale + 1e-13,
        err_msg="a delay of two samples must shift the response by two samples",
    )  # fmt: skip


def _check_saturation(machine: Machine, bound: BoundMachine) -> None:
    limit = np.broadcast_to(np.asarray(machine.drive.command_limit), (machine.n_axes,))
    limit = np.where(np.isfinite(limit), limit, 1.0)
    bounded = np.isfinite(np.broadcast_to(machine.drive.command_limit, limit.shape))
    for sign in (-1.0, 1.0):
        at = np.broadcast_to(sign * limit, (N_STEPS, machine.n_axes))
        beyond = np.where(bounded, 10.0, 1.0) * at
        a, b = _run(bound, _middle(machine), at)[0], _run(bound, _middle(machine), beyond)[0]
        assert np.array_equal(a, b), "a command beyond the limit must act like the limit"


def _check_encoder(machine: Machine, sample_time: float) -> None:
    bound, n_axes = machine.bind(sample_time), machine.n_axes
    resolution = np.broadcast_to(np.asarray(machine.sensor.resolution), (n_axes,))
    seen = np.asarray(_run(bound, _middle(machine), _commands(machine, bound))[1])
    counts = seen / np.where(resolution > 0.0, resolution, np.inf)
    # a position is a whole number times the resolution, rounded: 1e-16 of up to 1e8 counts
    assert np.max(np.abs(counts - np.round(counts))) < 1e-6, "positions are off the encoder's grid"
    if machine.sensor.noise is None:
        ideal = np.asarray(_run(bound, _middle(machine), _commands(machine, bound))[2])
        assert np.all(np.abs(seen - ideal) <= 0.5 * resolution + 1e-12), (
            "the encoder must show the nearest count"
        )

    def total(position: Any) -> Any:
        return jnp.sum(bound.measure(bound.init(position, KEY)).position)

    slope = jax.jit(jax.grad(total))(jnp.asarray(_middle(machine)) + 0.3 * resolution)
    np.testing.assert_allclose(
        slope, np.ones(n_axes), rtol=0, atol=1e-9,
        err_msg="rounding must let the gradient through",
    )  # fmt: skip


def _check_noise(machine: Machine, sample_time: float) -> None:
    bound, position = machine.bind(sample_time), _middle(machine)
    commands = _commands(machine, bound)
    first = np.asarray(_run(bound, position, commands, 1)[1])
    again = np.asarray(_run(bound, position, commands, 1)[1])
    assert np.array_equal(first, again), "the same key must give the same noise"
    noisy = replace_at(machine, "sensor.noise", 1e-3).bind(sample_time)
    one, other = (np.asarray(_run(noisy, position, commands, key)[1]) for key in (1, 2))
    assert not np.array_equal(one, other), "another key must give other noise"
    assert len(np.unique(one[:, 0])) > 1, "noise must change from sample to sample"
