"""Runs one program as LinuxCNC's [DISPLAY], and stores what the sampler saw in every servo cycle.

Runs under the Python that LinuxCNC was built for, started by ``linuxcnc_cycle_time.py``; needs the
standard library and LinuxCNC's modules only. Reads ``job.json`` beside it; writes ``samples.bin``
(rows of doubles: commanded positions, source line) and ``outcome.json``.
"""

from __future__ import annotations

import json
import time
from array import array
from pathlib import Path

import hal
import linuxcnc

HERE = Path(__file__).resolve().parent
START_LIMIT_S = 20.0
QUIET_S = 0.2  # the interpreter is idle and the queue empty for so long: the program has ended
POLL_S = 0.005
RESUME_S = 0.2  # before a program still at a stop is resumed again


class RefusedError(Exception):
    """LinuxCNC did not do what it was asked."""


class Run:
    def __init__(self, job):
        self.job = job
        self.status = linuxcnc.stat()
        self.command = linuxcnc.command()
        self.errors = linuxcnc.error_channel()
        component = hal.component("cycle_time")
        self.stream = hal.stream(component, hal.sampler_base, "f" * job["joints"] + "s")
        component.ready()
        self.file = (HERE / "samples.bin").open("wb")
        self.written = 0
        self.missing = 0
        self.last_number = None
        self.resumed_at = []
        self.messages = []

    def drain(self):
        """Move all waiting samples into the file; count those missing from the numbering."""
        rows = array("d")
        while self.stream.readable:
            sample = self.stream.read()
            if sample is None:
                break
            number = self.stream.sampleno
            if self.last_number is not None:
                self.missing += number - self.last_number - 1
            self.last_number = number
            rows.extend(float(value) for value in sample)
            self.written += 1
        rows.tofile(self.file)

    def poll(self):
        time.sleep(POLL_S)
        self.drain()
        self.status.poll()
        while (message := self.errors.poll()) is not None:
            kind, text = message
            if kind in (linuxcnc.NML_ERROR, linuxcnc.OPERATOR_ERROR):
                raise RefusedError(text.strip())
            self.messages.append(text.strip())

    def wait(self, condition, what):
        until = time.monotonic() + START_LIMIT_S
        while True:
            self.poll()
            if condition():
                return
            if time.monotonic() > until:
                raise RefusedError(f"LinuxCNC is not in this state after {START_LIMIT_S} s: {what}")

    def prepare(self):
        c, s = self.command, self.status
        c.state(linuxcnc.STATE_ESTOP_RESET)
        self.wait(lambda: s.task_state == linuxcnc.STATE_ESTOP_RESET, "emergency stop reset")
        c.state(linuxcnc.STATE_ON)
        self.wait(lambda: s.task_state == linuxcnc.STATE_ON, "machine on")
        c.mode(linuxcnc.MODE_MANUAL)
        self.wait(lambda: s.task_mode == linuxcnc.MODE_MANUAL, "manual mode")
        c.teleop_enable(0)
        c.home(-1)  # at once where it stands: the joints have no home switch
        self.wait(lambda: all(s.homed[: self.job["joints"]]), "homed")
        c.mode(linuxcnc.MODE_AUTO)
        self.wait(lambda: s.task_mode == linuxcnc.MODE_AUTO, "automatic mode")
        c.feedrate(self.job["feed_override"])
        c.wait_complete()
        c.program_open(self.job["program"])
        self.wait(lambda: s.file == self.job["program"], "program opened")

    def ended(self):
        s = self.status
        return (
            s.interp_state == linuxcnc.INTERP_IDLE
            and s.exec_state == linuxcnc.EXEC_DONE
            and s.queue == 0
            and s.inpos
        )

    def program(self):
        until = time.monotonic() + self.job["timeout"]
        self.command.auto(linuxcnc.AUTO_RUN, 0)
        quiet_since = None
        resumed = 0.0
        while True:
            self.poll()
            now = time.monotonic()
            if now > until:
                raise RefusedError(f"the program did not end in timeout = {self.job['timeout']} s")
            paused = self.status.interp_state == linuxcnc.INTERP_PAUSED and self.status.inpos
            if paused and now - resumed > RESUME_S:  # M0, M60: what an operator does
                resumed = now
                self.resumed_at.append(self.written)
                self.command.auto(linuxcnc.AUTO_RESUME)
            if not self.ended():
                quiet_since = None
            elif quiet_since is None:
                quiet_since = now
            elif now - quiet_since > QUIET_S:
                return


def main():
    job = json.loads((HERE / "job.json").read_text())
    outcome = {"refused": None}
    run = Run(job)
    try:
        run.prepare()
        run.program()
    except (RefusedError, linuxcnc.error) as error:
        outcome["refused"] = str(error)
        run.command.abort()
    run.drain()
    run.file.close()
    outcome |= {
        "messages": run.messages,
        "resumed_at": run.resumed_at,
        "overruns": run.stream.num_overruns,
        "missing": run.missing,
    }
    (HERE / "outcome.json").write_text(json.dumps(outcome))


main()
