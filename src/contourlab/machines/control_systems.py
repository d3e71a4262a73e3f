"""Systems of the python-control package as axes, and machines as such systems.

python-control is the optional extra ``control``; it is imported when one of these functions is
called.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import ConfigurationError, choices
from contourlab.machines.encoder import SIDES
from contourlab.machines.machine import Machine
from contourlab.machines.state_space import StateSpaceAxes

__all__ = ["from_control", "to_control"]


def _control() -> Any:
    try:
        import control
    except ModuleNotFoundError as error:
        raise ConfigurationError(
            "python-control is not installed; it is the optional extra control: "
            'pip install "contourlab[control]"'
        ) from error
    return control


def from_control(
    systems: Any, *, output: Literal["position", "velocity"] = "position"
) -> StateSpaceAxes:
    """Return axes from a system of python-control, or from one SISO system per axis.

    Parameters
    ----------
    systems
        A ``TransferFunction`` or ``StateSpace`` from all commands to all axes, or a sequence of
        them with one input and one output each. Continuous, or discrete with a known sample time.
    output
        What the systems give: positions [m] or velocities [m/s].

    Returns
    -------
    StateSpaceAxes
        The same model: states of a ``StateSpace`` are kept, a ``TransferFunction`` is realised (a
        MIMO one, which has no small realisation there, entry by entry).

    Raises
    ------
    ConfigurationError
        python-control is not installed; something that is no linear system; a discrete system
        without a sample time; or axes that are refused (unstable, not causal, not square).
    """
    control = _control()
    if not isinstance(systems, Sequence) or isinstance(systems, str | bytes):
        return _axes(control, systems, output)
    models = [_axes(control, one, output) for one in systems]
    for k, one in enumerate(systems):
        if (one.ninputs, one.noutputs) != (1, 1):
            raise ConfigurationError(
                "systems of a sequence must have one input and one output each, got "
                f"{one.ninputs} and {one.noutputs} at position {k}"
            )
    return StateSpaceAxes.per_axis(models)


def _axes(control: Any, systems: Any, output: Literal["position", "velocity"]) -> StateSpaceAxes:
    """Axes from one system, whatever the number of its inputs."""
    if isinstance(systems, control.TransferFunction):
        system = _realised(control, systems)
    elif isinstance(systems, control.StateSpace):
        system = systems
    else:
        raise ConfigurationError(
            "systems must be a TransferFunction or StateSpace of python-control, or a sequence of "
            f"them, got {type(systems).__name__}"
        )
    time = systems.dt
    if time is True:
        raise ConfigurationError(
            "a discrete system needs its sample time: dt is True, give it in s"
        )
    direct = np.asarray(system.D, float)
    return StateSpaceAxes(
        state_matrix=np.asarray(system.A, float), input_matrix=np.asarray(system.B, float),
        output_matrix=np.asarray(system.C, float), direct_matrix=direct if direct.any() else None,
        sample_time=float(time) if time else None, output=output,
    )  # fmt: skip


def _realised(control: Any, function: Any) -> Any:
    """Return a state space of a transfer function, entry by entry if it has several."""
    parts = []
    for row in range(function.noutputs):
        for column in range(function.ninputs):
            top = np.trim_zeros(np.asarray(function.num_array[row, column], float), "f")
            bottom = np.trim_zeros(np.asarray(function.den_array[row, column], float), "f")
            if len(top) > len(bottom):
                raise ConfigurationError(
                    f"the transfer function from input {column} to output {row} is improper: its "
                    "numerator is of higher degree than its denominator"
                )
            if len(top) or row == column:
                parts.append((row, column, *_companion(top, bottom)))
    order = sum(len(part[2]) for part in parts)
    a = np.zeros((order, order))
    b, c = np.zeros((order, function.ninputs)), np.zeros((function.noutputs, order))
    d = np.zeros((function.noutputs, function.ninputs))
    first = 0
    for row, column, one_a, one_b, one_c, one_d in parts:
        rows = slice(first, first + len(one_a))
        a[rows, rows], b[rows, column], c[row, rows] = one_a, one_b, one_c
        d[row, column] = one_d
        first += len(one_a)
    return control.ss(a, b, c, d, function.dt, remove_useless_states=False)


def _companion(
    top: NDArray[Any], bottom: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], float]:
    order = len(bottom) - 1
    full = np.concatenate([np.zeros(order + 1 - len(top)), top]) / bottom[0]
    low = bottom[1:] / bottom[0]
    direct = float(full[0])
    a, b = np.eye(order, k=1), np.zeros(order)
    if order:
        a[-1], b[-1] = -low[::-1], 1.0
    return a, b, (full[1:] - direct * low)[::-1], direct


def to_control(
    machine: Machine,
    *,
    axis: str | None = None,
    sample_time: float | None = None,
    side: str = "tool",
) -> Any:
    """Return the linear part of a machine as a ``StateSpace`` of python-control.

    From commands to axis positions. Left out: dry friction, backlash, cogging, geometric errors,
    the limit of the command, and the encoders' noise and rounding. The tool map is not applied.

    Parameters
    ----------
    machine
        Any machine whose dynamics have a linear part.
    axis
        Name of the one axis that is wanted; all if not given.
    sample_time
        For the discrete system that a command held for this time sees, the drive's computing delay
        included exactly [s]. Not given: the dynamics as they are, without the delay.
    side
        Position of the ``tool`` (the load), or of the ``motor``.

    Returns
    -------
    control.StateSpace
        Inputs and outputs are named after the axes.

    Raises
    ------
    ConfigurationError
        python-control is not installed; no such axis; a sample time that is no positive number; or
        a discrete model is asked for at another sample time.
    """
    control = _control()
    if side not in SIDES:
        raise ConfigurationError(f"unknown side {side!r}; {choices(side, SIDES)}")
    if axis is not None and axis not in machine.names:
        raise ConfigurationError(f"no axis {axis!r}; {choices(axis, machine.names)}")
    if sample_time is not None:
        sample_time = _period(sample_time)
    model = machine.dynamics.linear(machine.n_axes)
    a, b = np.asarray(model.state), np.asarray(model.input)
    c = np.asarray(model.output if side == "tool" else model.motor_output)
    time = model.sample_time
    if sample_time is not None:
        a, b, c = _held(machine, model, c, sample_time)
        time = sample_time
    names = list(machine.names)
    if axis is not None:
        k = names.index(axis)
        b, c, names = b[:, k : k + 1], c[k : k + 1], [axis]
    return control.StateSpace(
        a, b, c, np.zeros((len(c), b.shape[1])), time or 0, inputs=[f"command {n}" for n in names],
        outputs=[f"position {n}" for n in names], remove_useless_states=False,
    )  # fmt: skip


def _period(value: Any) -> float:
    refused = isinstance(value, bool | str | bytes)
    try:
        period = math.nan if refused else float(value)
    except (TypeError, ValueError):
        period = math.nan
    if not 0.0 < period < math.inf:
        raise ConfigurationError(f"sample_time must be > 0 s, got {value!r}")
    return period


def _held(
    machine: Machine, model: Any, c: NDArray[Any], sample_time: float
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """A, B and C for held commands that wait in the drive."""
    from scipy.linalg import expm

    n, m = model.input.shape
    waiting, fractions = machine.drive.split(sample_time)
    transition, inputs = np.eye(n), []
    if model.sample_time is not None:
        if len(fractions) > 1 or abs(sample_time - model.sample_time) > 1e-9 * sample_time:
            raise ConfigurationError(
                f"the dynamics were identified at {model.sample_time:g} s and hold there only, "
                f"with a delay of whole periods, got {sample_time:g} s; use the continuous() form"
            )
        transition, inputs = model.state, [model.input]
    else:
        for fraction in fractions:
            block = np.zeros((n + m, n + m))
            block[:n] = np.concatenate([model.state, model.input], 1) * fraction * sample_time
            whole = expm(block)
            inputs = [whole[:n, :n] @ earlier for earlier in inputs] + [whole[:n, n:]]
            transition = whole[:n, :n] @ transition
    if not waiting:
        return transition, inputs[0], c
    # states: the axes, then the commands that wait, the oldest first
    size = n + waiting * m
    a, b = np.zeros((size, size)), np.zeros((size, m))
    a[:n, :n] = transition
    a[n : size - m, n + m :] = np.eye((waiting - 1) * m)
    b[size - m :] = np.eye(m)
    for k, drive in enumerate(inputs):  # the oldest acts first; the last may be the new one
        if k < waiting:
            a[:n, n + k * m : n + (k + 1) * m] = drive
        else:
            b[:n] = drive
    return a, b, np.concatenate([c, np.zeros((len(c), waiting * m))], 1)
