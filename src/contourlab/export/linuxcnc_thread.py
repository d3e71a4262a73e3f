"""A LinuxCNC component in a real servo thread, on given inputs: what it puts out, cycle by cycle.

Needs LinuxCNC. The numbers go in and come back as full doubles, so that they can be compared bit
for bit with the same C called from Python (:class:`~contourlab.export.linuxcnc_servo.ServoLayer`).
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.export import hal_stream
from contourlab.export.linuxcnc_session import LINUXCNC_PYTHON, LinuxcncError, run_private

__all__ = ["run_in_servo_thread"]

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
    rows = np.concatenate([*columns, inputs["enable"][:, None]], axis=1).astype(float)
    file_in, file_out = folder / "rows_in.bin", folder / "rows_out.bin"
    rows.tofile(file_in)
    file_out.unlink(missing_ok=True)
    period = round(float(inputs["period"][0]) * 1e9)
    hal = folder / "thread.hal"
    types_in, types_out = ("".join(kind for _, kind in pins) for pins in (pins_in, pins_out))
    stream = shlex.join([LINUXCNC_PYTHON, str(Path(hal_stream.__file__)), types_in, str(file_in),
                         types_out, str(file_out), str(len(rows))])  # fmt: skip
    lines = [
        f"loadrt threads name1=servo-thread period1={period}",
        f"loadrt {module.stem}",
        f"loadrt streamer depth={len(rows) + 10} cfg={types_in}",
        f"loadrt sampler depth={len(rows) + 1000} cfg={types_out}",
        *(f"setp {name}.{key} {value!r}" for key, value in (settings or {}).items()),
        *(f"net in{k} streamer.0.pin.{k} => {pin}" for k, (pin, _) in enumerate(pins_in)),
        *(f"net out{k} {pin} => sampler.0.pin.{k}" for k, (pin, _) in enumerate(pins_out)),
        *(f"addf {function} servo-thread" for function in ("streamer.0", f"{name}.cycle",
                                                            "sampler.0")),
        f"loadusr -w {stream}",
    ]  # fmt: skip
    hal.write_text("\n".join(lines) + "\n")
    run = run_private(["halrun", "-f", str(hal)], modules=[module], folder=folder, timeout=timeout)
    if not file_out.is_file():  # halrun exits with 0 whatever happened
        raise LinuxcncError(f"no rows came back from the servo thread:\n{run.stdout}{run.stderr}")
    out = np.fromfile(file_out).reshape(len(rows), len(pins_out))
    found: dict[str, NDArray[Any]] = {"command": out[:, :n], "following_error": out[:, n : 2 * n]}
    for k, (field, _, _) in enumerate(NUMBERS_OUT):
        found[field] = out[:, 2 * n + k].astype(np.int32)
    return found
