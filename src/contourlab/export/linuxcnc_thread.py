"""A LinuxCNC component in a real servo thread, on given inputs: what it puts out, cycle by cycle.

Needs LinuxCNC. The numbers go in and come back as full doubles, so that they can be compared bit
for bit with the same C called from Python (:class:`~contourlab.export.linuxcnc_servo.ServoLayer`).
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.export import hal_stream
from contourlab.export.linuxcnc_session import LINUXCNC_PYTHON, LinuxcncError, run_private

__all__ = ["run_in_servo_thread", "through_thread"]

VECTORS_IN = (
    ("reference_position", "reference-position"),
    ("reference_velocity", "reference-velocity"),
    ("reference_acceleration", "reference-acceleration"),
    ("position", "position-fb"),
    ("velocity", "velocity-fb"),
)
NUMBERS_OUT = (
    ("running", "running", "b"),
    ("fault", "fault-code", "s"),
    ("saturated", "saturated", "b"),
    ("status", "status", "s"),
)


def run_in_servo_thread(
    module: Path,
    inputs: NDArray[Any],
    *,
    folder: Path,
    settings: Mapping[str, float] | None = None,
    timeout: float = 60.0,
) -> dict[str, NDArray[Any]]:
    """Return what a component puts out in a servo thread, one row for each cycle.

    Parameters
    ----------
    module
        The compiled component, named for its prefix.
    inputs
        As :meth:`ServoLayer.inputs` makes them; the first row must be disabled, since the thread
        may run some cycles on it. The thread's period is that of the first row.
    folder
        Working folder.
    settings
        HAL parameters to set, by name under the component.
    timeout
        In all [s].

    Returns
    -------
    dict
        ``command``, ``following_error``, ``running``, ``fault``, ``saturated``, ``status``.

    Raises
    ------
    LinuxcncError
        The session failed; holds what it printed.
    RefusedError
        There is no LinuxCNC.
    """
    name = module.stem.replace("_", "-")
    n = inputs["position"].shape[1]
    pins_in = [(f"{name}.{pin}-{k}", "f") for _, pin in VECTORS_IN for k in range(n)]
    pins_in.append((f"{name}.enable", "b"))
    pins_out = [(f"{name}.{pin}-{k}", "f") for pin in ("command", "following-error")
                for k in range(n)]  # fmt: skip
    pins_out += [(f"{name}.{pin}", kind) for _, pin, kind in NUMBERS_OUT]
    columns = [inputs[field] for field, _ in VECTORS_IN]
    out = through_thread(
        np.concatenate([*columns, inputs["enable"][:, None]], axis=1),
        pins_in=pins_in, pins_out=pins_out, functions=[f"{name}.cycle"], modules=[module],
        lines=[
            f"loadrt {module.stem}",
            *(f"setp {name}.{key} {value!r}" for key, value in (settings or {}).items()),
        ],
        period=float(inputs["period"][0]), folder=folder, timeout=timeout,
    )  # fmt: skip
    found: dict[str, NDArray[Any]] = {"command": out[:, :n], "following_error": out[:, n : 2 * n]}
    for k, (field, _, _) in enumerate(NUMBERS_OUT):
        found[field] = out[:, 2 * n + k].astype(np.int32)
    return found


def through_thread(
    rows: NDArray[Any], *, pins_in: Sequence[tuple[str, str]],
    pins_out: Sequence[tuple[str, str]], functions: Sequence[str], lines: Sequence[str],
    modules: Sequence[Path], period: float, folder: Path, timeout: float = 60.0,
) -> NDArray[Any]:  # fmt: skip
    """Return what some pins show in each cycle of a servo thread, given what others are set to.

    Parameters
    ----------
    rows
        One row a cycle, shape (n_cycles, number of pins_in).
    pins_in, pins_out
        Names, with HAL's letter of their type: f, b, s or u.
    functions
        What runs in the thread, in this order, between setting and showing.
    lines
        Of HAL, that load and set what is run.
    modules
        Compiled components that are not LinuxCNC's own.
    period
        Of the thread [s].
    folder
        Working folder.
    timeout
        In all [s].

    Raises
    ------
    LinuxcncError
        The session failed; holds what it printed.
    RefusedError
        There is no LinuxCNC.
    """
    file_in, file_out, hal = (folder / name for name in ("rows.in", "rows.out", "thread.hal"))
    np.ascontiguousarray(rows, float).tofile(file_in)
    file_out.unlink(missing_ok=True)
    types_in, types_out = ("".join(kind for _, kind in pins) for pins in (pins_in, pins_out))
    stream = shlex.join([LINUXCNC_PYTHON, str(Path(hal_stream.__file__)), types_in, str(file_in),
                         types_out, str(file_out), str(len(rows))])  # fmt: skip
    text = [
        f"loadrt threads name1=servo-thread period1={round(period * 1e9)}",
        f"loadrt streamer depth={len(rows) + 10} cfg={types_in}",
        f"loadrt sampler depth={len(rows) + 1000} cfg={types_out}",
        *lines,
        *(f"net in{k} streamer.0.pin.{k} => {pin}" for k, (pin, _) in enumerate(pins_in)),
        *(f"net out{k} {pin} => sampler.0.pin.{k}" for k, (pin, _) in enumerate(pins_out)),
        *(f"addf {name} servo-thread" for name in ("streamer.0", *functions, "sampler.0")),
        f"loadusr -w {stream}",
    ]
    hal.write_text("\n".join(text) + "\n")
    run = run_private(["halrun", "-f", str(hal)], modules=modules, folder=folder, timeout=timeout)
    if not file_out.is_file():  # halrun exits with 0 whatever happened
        raise LinuxcncError(f"no rows came back from the servo thread:\n{run.stdout}{run.stderr}")
    return np.fromfile(file_out).reshape(len(rows), len(pins_out))
