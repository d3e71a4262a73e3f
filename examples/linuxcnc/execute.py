#!/usr/bin/python3
"""Runs one program in LinuxCNC without a screen, and logs every servo period to a CSV file.

LinuxCNC starts this in place of a user interface ([DISPLAY] DISPLAY); it needs LinuxCNC's own
Python and nothing of contourlab. The program and the log are named by the environment variables
CONTOURLAB_PROGRAM and CONTOURLAB_LOG; without a screen there is nobody to ask.
"""

import os
import sys
import threading
import time

import _hal
import linuxcnc

COLUMNS = [
    "X commanded [mm]", "Y commanded [mm]",
    "X velocity [mm/s]", "Y velocity [mm/s]",
    "X acceleration [mm/s^2]", "Y acceleration [mm/s^2]",
    "X actual [mm]", "Y actual [mm]",
    "X force [N]", "Y force [N]",
    "X tool [mm]", "Y tool [mm]",
    "enable", "running", "fault code", "status",
]  # fmt: skip
TYPES = "f" * 12 + "bbss"
PERIOD = 0.001
ENABLE = 12
SETTLE = 0.3


class Log(threading.Thread):
    """Takes rows from the sampler as they come."""

    def __init__(self):
        super().__init__(daemon=True)
        self.component = _hal.component(f"log{os.getpid()}")
        self.stream = _hal.stream(self.component, _hal.sampler_base, TYPES)
        self.component.ready()
        self.rows, self.numbers, self.stop = [], [], threading.Event()

    def run(self):
        """Read until told to stop, and what is left."""
        while True:
            last = self.stop.is_set()
            while self.stream.readable:
                self.rows.append(self.stream.read())
                self.numbers.append(self.stream.sampleno)
            if last:
                return
            time.sleep(0.005)

    def write(self, path):
        """Write the rows from just before the machine was enabled."""
        first = next((k for k, row in enumerate(self.rows) if row[ENABLE]), None)
        if first is None:
            raise SystemExit("the machine was never enabled")
        first = max(first - 2, 0)
        numbers = self.numbers[first:]
        if numbers != list(range(numbers[0], numbers[0] + len(numbers))):
            raise SystemExit("rows were lost: the log was not read fast enough")
        with open(path + ".part", "w") as file:
            file.write(",".join(["time [s]", *COLUMNS]) + "\n")
            for k, row in enumerate(self.rows[first:]):
                values = [repr(v) if isinstance(v, float) else str(int(v)) for v in row]
                file.write(",".join([f"{k * PERIOD:.3f}", *values]) + "\n")
        os.replace(path + ".part", path)


def wait(what, condition, seconds):
    """Wait until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f"LinuxCNC did not become {what} within {seconds:g} s")
        time.sleep(0.01)


def main():
    """Run the program."""
    program, path = os.environ["CONTOURLAB_PROGRAM"], os.environ["CONTOURLAB_LOG"]
    log = Log()
    log.start()
    command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()

    def now():
        status.poll()
        return status

    command.state(linuxcnc.STATE_ESTOP_RESET)
    wait("ready", lambda: now().task_state == linuxcnc.STATE_ESTOP_RESET, 30)
    command.state(linuxcnc.STATE_ON)
    wait("enabled", lambda: now().task_state == linuxcnc.STATE_ON, 30)
    command.mode(linuxcnc.MODE_AUTO)
    command.wait_complete()
    command.program_open(program)
    command.auto(linuxcnc.AUTO_RUN, 0)
    wait("running", lambda: now().interp_state != linuxcnc.INTERP_IDLE, 30)
    ok = True
    while now().interp_state != linuxcnc.INTERP_IDLE or not status.inpos:
        said = errors.poll()
        if said:
            print("LinuxCNC:", said[1], file=sys.stderr)
            ok = False
        if status.task_state != linuxcnc.STATE_ON:
            ok = False
            break
        time.sleep(0.01)
    time.sleep(SETTLE)
    log.stop.set()
    log.join()
    log.write(path)
    if not ok:
        raise SystemExit("the program did not run to its end")


if __name__ == "__main__":
    main()
