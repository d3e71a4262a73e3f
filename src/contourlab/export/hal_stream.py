"""Streams rows of full doubles through HAL, and writes what comes back; runs inside a session.

It is started by LinuxCNC's own Python (which has ``_hal``), knows nothing of contourlab and needs
nothing but the standard library. ``halstreamer`` and ``halsampler`` would print six decimals.

    hal_stream.py IN_TYPES IN_FILE OUT_TYPES OUT_FILE N_ROWS

Types are HAL's letters (f, b, s, u); files hold float64 rows, whatever the type. The thread is
started here, once the first queue is full, and stopped when as many rows have come back.
"""

import array
import os
import subprocess
import sys
import time

__all__: list[str] = []

PATIENCE = 30.0
"""Seconds without a row before giving up."""


def main() -> None:
    """Stream the rows."""
    import _hal  # type: ignore[import-not-found]  # of LinuxCNC's Python

    types_in, file_in, types_out, file_out, n = sys.argv[1:]
    n_rows = int(n)
    numbers = array.array("d")
    with open(file_in, "rb") as file:
        numbers.frombytes(file.read())
    convert = {"f": float, "b": bool, "s": int, "u": int}
    width = len(types_in)
    component = _hal.component("rows")
    there = _hal.stream(component, _hal.streamer_base, types_in)
    back = _hal.stream(component, _hal.sampler_base, types_out)
    component.ready()
    for k in range(n_rows):
        row = numbers[k * width : (k + 1) * width]
        there.write(tuple(convert[t](v) for t, v in zip(types_in, row, strict=True)))
    subprocess.run(["halcmd", "start"], check=True)
    found = array.array("d")
    counts: list[int] = []
    deadline = time.monotonic() + PATIENCE
    while len(counts) < n_rows and time.monotonic() < deadline:
        while back.readable and len(counts) < n_rows:
            found.extend(float(v) for v in back.read())
            counts.append(back.sampleno)
            deadline = time.monotonic() + PATIENCE
        time.sleep(0.01)
    subprocess.run(["halcmd", "stop"], check=True)
    if len(counts) < n_rows or counts != list(range(counts[0], counts[0] + n_rows)):
        sys.exit(f"{len(counts)} of {n_rows} rows came back, or some were lost")
    with open(f"{file_out}.part", "wb") as file:
        found.tofile(file)
    os.replace(f"{file_out}.part", file_out)


if __name__ == "__main__":
    main()
