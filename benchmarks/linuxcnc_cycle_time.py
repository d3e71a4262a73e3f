"""Cycle time that LinuxCNC's own trajectory planner needs for a program under given axis limits.

The program runs headless in LinuxCNC with trivial kinematics and ideal drives (the position
command is the position). A sampler in the servo thread records every commanded position, and the
time is counted in servo cycles of 1 ms from the first to the last cycle that moves: it does not
depend on how fast the computer is. Dwells, which LinuxCNC times by the clock, count. A standstill
with a stop for the operator in it (M0, M60), resumed at once, does not; tool changes are immediate.

LinuxCNC has limits of velocity and acceleration, none of jerk. The run takes as long as the motion:
LinuxCNC without a real-time kernel keeps to the clock, and the planner's cycle stays at 1 ms.
The commands leave LinuxCNC through its cubic interpolator, which spreads a change of acceleration
over four cycles. A loaded computer may starve the planner's queue: compare repeated runs.

Needs Linux, LinuxCNC 2.9 and root, which makes private namespaces: no process or lock is left
behind (after SIGKILL only a temporary folder), and runs do not disturb one another.

    python benchmarks/linuxcnc_cycle_time.py PROGRAM.ngc --velocity 0.5 --acceleration 5 [--json]
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

SERVO_PERIOD = 1e-3
PYTHON = "/usr/bin/python3"  # the one that LinuxCNC's modules are built for
METRE = {"mm": 1000.0, "inch": 1000.0 / 25.4}
LINEAR_AXES = "XYZUVW"
TRAVEL = 100.0  # m: soft limits that do not bind
FIFO_DEPTH = 60_000
MOVING = 1e-12  # m in one cycle; rounding of a position at rest is below it
START_S = 90.0  # allowance for starting and ending LinuxCNC

# The mount namespace gives LinuxCNC, whose lock file has a fixed name in /tmp, a /tmp of its own.
ENTER = 'mount --bind "$1" "$2/program" && mount --rbind "$2" /tmp && cd /tmp && '
ENTER += "exec linuxcnc -r /tmp/machine.ini"
ISOLATE = ["setpriv", "--pdeathsig", "KILL", "unshare", "--ipc", "--net", "--pid", "--fork"]
ISOLATE += ["--mount-proc", "--kill-child", "sh", "-c", ENTER, "sh"]


class LinuxCncError(RuntimeError):
    """LinuxCNC is absent, did not run, or refused the program."""


def require_linuxcnc():
    """Raise ``LinuxCncError`` unless LinuxCNC can be run here."""
    if os.geteuid() != 0:
        raise LinuxCncError("root is needed: the run is isolated in namespaces of its own")
    for name in ("linuxcnc", "milltask", "halcmd", "unshare", "setpriv"):
        if shutil.which(name) is None:
            raise LinuxCncError(f"{name} is not installed (Debian: linuxcnc-uspace, util-linux)")
    found = subprocess.run([PYTHON, "-c", "import linuxcnc, hal"], capture_output=True, text=True)
    if found.returncode:
        raise LinuxCncError(f"{PYTHON} does not import LinuxCNC's modules: {found.stderr.strip()}")


def per_axis(name, value, axes):
    """One positive number per axis, from one number or one per axis."""
    values = np.atleast_1d(np.asarray(value, dtype=float))
    if values.size not in (1, len(axes)) or not np.all((values > 0) & np.isfinite(values)):
        raise ValueError(f"{name} must be one number > 0 or {len(axes)} of them, got {value}")
    return np.broadcast_to(values, len(axes))


def ini_text(axes, velocity, acceleration, units, startup):
    """The INI file; lengths in machine units."""
    scale = METRE[units]
    lines = [
        "[EMC]", "VERSION = 1.1", "MACHINE = cycle-time", "DEBUG = 0",
        "[DISPLAY]", "DISPLAY = /tmp/run_program.py", "MAX_FEED_OVERRIDE = 1000000",
        "[TASK]", "TASK = milltask", "CYCLE_TIME = 0.001",
        "[RS274NGC]", "PARAMETER_FILE = /tmp/parameters.var", "SUBROUTINE_PATH = /tmp/program",
        f"RS274NGC_STARTUP_CODE = {startup}",
        "[EMCMOT]", "EMCMOT = motmod", "COMM_TIMEOUT = 1.0",
        f"SERVO_PERIOD = {round(SERVO_PERIOD * 1e9)}",
        "[EMCIO]", "EMCIO = io", "CYCLE_TIME = 0.001", "TOOL_TABLE = /tmp/tools.tbl",
        "[HAL]", "HALFILE = /tmp/machine.hal",
        "[KINS]", f"KINEMATICS = trivkins coordinates={axes}", f"JOINTS = {len(axes)}",
        "[TRAJ]", f"COORDINATES = {' '.join(axes)}", f"LINEAR_UNITS = {units}",
        "ANGULAR_UNITS = degree", "NO_FORCE_HOMING = 1",
    ]  # fmt: skip
    # Along a path an axis-limited machine reaches at most the norm of the limits.
    for name, limit in (("VELOCITY", velocity), ("ACCELERATION", acceleration)):
        bound = scale * float(np.linalg.norm(limit)) * 1.01
        lines += [f"DEFAULT_LINEAR_{name} = {bound:.17g}", f"MAX_LINEAR_{name} = {bound:.17g}"]
    for joint, axis in enumerate(axes):
        limits = [
            f"MIN_LIMIT = {-scale * TRAVEL}", f"MAX_LIMIT = {scale * TRAVEL}",
            f"MAX_VELOCITY = {scale * velocity[joint]:.17g}",
            f"MAX_ACCELERATION = {scale * acceleration[joint]:.17g}",
        ]  # fmt: skip
        following = f"{scale * TRAVEL}"
        lines += [f"[AXIS_{axis}]", *limits, f"[JOINT_{joint}]", *limits, "TYPE = LINEAR"]
        lines += ["HOME = 0", "HOME_SEARCH_VEL = 0", "HOME_LATCH_VEL = 0", "HOME_SEQUENCE = 0"]
        lines += [f"FERROR = {following}", f"MIN_FERROR = {following}"]
    return "\n".join(lines) + "\n"


def hal_text(joints):
    """Ideal drives, a tool changer that is always ready, and the sampler."""
    lines = [
        "loadrt [KINS]KINEMATICS",
        "loadrt [EMCMOT]EMCMOT servo_period_nsec=[EMCMOT]SERVO_PERIOD num_joints=[KINS]JOINTS",
        f"loadrt sampler depth={FIFO_DEPTH} cfg={'f' * joints}s",
        *(f"addf {name} servo-thread" for name in ("motion-command-handler", "motion-controller")),
        "addf sampler.0 servo-thread",
        "net estop iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in",
        "net prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared",
        "net change iocontrol.0.tool-change => iocontrol.0.tool-changed",
        f"net line motion.program-line => sampler.0.pin.{joints}",
    ]
    for j in range(joints):
        command, feedback = f"joint.{j}.motor-pos-cmd", f"joint.{j}.motor-pos-fb"
        lines.append(f"net position{j} {command} => {feedback} sampler.0.pin.{j}")
    return "\n".join(lines) + "\n"


def write_job(folder, program, axes, velocity, acceleration, units, startup, **job):
    """Everything that LinuxCNC reads, in its future /tmp."""
    folder.chmod(0o1777)
    (folder / "program").mkdir()
    (folder / "machine.ini").write_text(ini_text(axes, velocity, acceleration, units, startup))
    (folder / "machine.hal").write_text(hal_text(len(axes)))
    (folder / "tools.tbl").write_text("".join(f"T{n} P{n} Z0 D0\n" for n in range(1, 51)))
    job |= {"joints": len(axes), "program": f"/tmp/program/{program.name}"}
    (folder / "job.json").write_text(json.dumps(job))
    source = Path(__file__).with_name("linuxcnc") / "run_program.py"
    display = folder / "run_program.py"
    display.write_text(f"#!{PYTHON}\n{source.read_text()}")
    display.chmod(0o755)


def run_linuxcnc(folder, program, timeout):
    """Run it to its end; whatever happens, all its processes are gone afterwards."""
    environment = {
        "PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/tmp", "LANG": "C.UTF-8",
        "RTAPI_UID": "65534",  # LinuxCNC refuses to run its real-time part as root
        "RTAPI_FIFO_PATH": "/tmp/rtapi_fifo",
    }  # fmt: skip
    command = [*ISOLATE, str(program.parent), str(folder)]
    with (folder / "log.txt").open("w") as log:
        process = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
            start_new_session=True,
        )  # fmt: skip
        try:
            process.wait(timeout + START_S)
        except subprocess.TimeoutExpired:
            raise LinuxCncError(f"LinuxCNC did not end in {timeout + START_S} s") from None
        finally:
            process.kill()  # its child is the first process of the namespace and takes all along
            process.wait()
    outcome = folder / "outcome.json"
    if not outcome.exists():
        tail = "\n".join((folder / "log.txt").read_text(errors="replace").splitlines()[-15:])
        raise LinuxCncError(f"LinuxCNC did not run the program; its last words:\n{tail}")
    return json.loads(outcome.read_text())


def measure(samples, outcome, axes, velocity, acceleration, scale):
    """Cycle time and greatest velocities and accelerations from the commanded positions [m]."""
    position = samples[:, : len(axes)] / scale
    step = np.diff(position, axis=0)
    moving = np.flatnonzero(np.any(np.abs(step) > MOVING, axis=1))
    if not moving.size:
        raise LinuxCncError("the program moves nothing")
    stop = {}  # cycles at rest waiting for the operator, by the last cycle that moved before
    for resumed in outcome["resumed_at"]:
        before, after = moving[moving < resumed - 1], moving[moving >= resumed - 1]
        if before.size and after.size:
            stop[int(before[-1])] = int(after[0] - before[-1] - 1)
    stops = sum(stop.values())
    cycles = int(moving[-1] - moving[0] + 1)
    window = slice(max(int(moving[0]) - 1, 0), int(moving[-1]) + 3)
    top_velocity = np.max(np.abs(step), axis=0) / SERVO_PERIOD
    top_acceleration = np.max(np.abs(np.diff(step, axis=0)), axis=0) / SERVO_PERIOD**2
    result = {
        "cycle_time_s": (cycles - stops) * SERVO_PERIOD,
        "standstill_s": (cycles - stops - moving.size) * SERVO_PERIOD,
        "operator_stops": len(stop),
        "samples": cycles - stops,
        "path_length_m": float(np.sum(np.linalg.norm(step, axis=1))),
        "max_velocity": top_velocity.tolist(),
        "max_acceleration": top_acceleration.tolist(),
        "velocity_over_limit": (top_velocity / velocity).tolist(),
        "acceleration_over_limit": (top_acceleration / acceleration).tolist(),
    }
    return result, position[window], samples[window, len(axes)].astype(int)


def linuxcnc_cycle_time(
    program, *, velocity, acceleration, axes="XYZ", units="mm", startup="", feed_override=1.0,
    timeout=600.0, record=None,
):  # fmt: skip
    """Run a program in LinuxCNC and measure its motion.

    Parameters
    ----------
    program
        G-code file. Subprograms are looked for in its folder.
    velocity, acceleration
        Limits of the axes, one number or one per axis [m/s], [m/s²].
    axes
        Letters of the linear axes, each a joint.
    units
        Machine units, "mm" or "inch": those of a program that has no G20 or G21.
    startup
        Codes in force before the program, such as "G64 P0.05". LinuxCNC starts in G64 without
        tolerance.
    feed_override
        Factor on the programmed feed.
    timeout
        Longest run of the program [s].
    record
        File for the commanded positions (.npz): time [s], position (n, n_axes) [m], line.

    Returns
    -------
    dict
        ``cycle_time_s``, ``samples`` (servo cycles), ``standstill_s`` within it, greatest velocity
        and acceleration per axis from differences, [m/s] and [m/s²], and as a share of the limits.

    Raises
    ------
    LinuxCncError
        Without LinuxCNC, or with its message if it refuses the program.
    ValueError
        For arguments out of range.
    """
    program = Path(program).resolve()
    if not program.is_file():
        raise ValueError(f"program must be a file, got {program}")
    if units not in METRE:
        raise ValueError(f"units must be one of {', '.join(METRE)}, got {units!r}")
    if not axes or set(axes) - set(LINEAR_AXES) or len(set(axes)) < len(axes):
        raise ValueError(f"axes must be different letters of {LINEAR_AXES}, got {axes!r}")
    for name, value in (("feed_override", feed_override), ("timeout", timeout)):
        if not 0 < value <= 1e6:
            raise ValueError(f"{name} must be in (0, 1e6], got {value}")
    velocity = per_axis("velocity", velocity, axes)
    acceleration = per_axis("acceleration", acceleration, axes)
    require_linuxcnc()
    with tempfile.TemporaryDirectory(prefix="cycle_time_") as name:
        folder = Path(name)
        write_job(
            folder, program, axes, velocity, acceleration, units, startup,
            timeout=timeout, feed_override=feed_override,
        )  # fmt: skip
        outcome = run_linuxcnc(folder, program, timeout)
        if outcome["refused"] is not None:
            raise LinuxCncError(f"{program.name}: {outcome['refused']}")
        if outcome["overruns"] or outcome["missing"]:
            raise LinuxCncError(
                f"samples were lost: {outcome['overruns']} overruns, {outcome['missing']} missing"
            )
        samples = np.fromfile(folder / "samples.bin").reshape(-1, len(axes) + 1)
    result, position, line = measure(samples, outcome, axes, velocity, acceleration, METRE[units])
    if record is not None:
        time = SERVO_PERIOD * np.arange(len(position))
        np.savez_compressed(record, time=time, position=position, line=line, axes=list(axes))
    limits = {"velocity": velocity.tolist(), "acceleration": acceleration.tolist(), "jerk": None}
    return {"program": program.name, "axes": axes, "limits": limits, **result,
            "messages": outcome["messages"]}  # fmt: skip


def numbers(text):
    """One number or several with commas, as an argument."""
    return [float(part) for part in text.split(",")]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("--velocity", type=numbers, required=True, metavar="M/S[,…]")
    parser.add_argument("--acceleration", type=numbers, required=True, metavar="M/S2[,…]")
    parser.add_argument("--axes", default="XYZ")
    parser.add_argument("--units", choices=list(METRE), default="mm")
    parser.add_argument("--startup", default="", help="codes before the program: 'G64 P0.05'")
    parser.add_argument("--feed-override", type=float, default=1.0)
    parser.add_argument("--timeout", type=float, default=600.0, help="of the program [s]")
    parser.add_argument("--record", type=Path, help="file for the commanded positions (.npz)")
    parser.add_argument("--json", action="store_true")
    options = vars(parser.parse_args())
    as_json = options.pop("json")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the temporary folder goes
    try:
        result = linuxcnc_cycle_time(options.pop("program"), **options)
    except (LinuxCncError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
    if as_json:
        print(json.dumps(result))
        return
    print(f"{result['program']}: {result['cycle_time_s']:.3f} s, {result['samples']} servo cycles")
    print(f"  at rest {result['standstill_s']:.3f} s, path {result['path_length_m']:.6f} m")
    for what, unit in (("velocity", "m/s"), ("acceleration", "m/s²")):
        for j, axis in enumerate(result["axes"]):
            top, share = result[f"max_{what}"][j], result[f"{what}_over_limit"][j]
            print(
                f"  {axis} {what:12} up to {top:9.5f} {unit:4} = {100 * share:6.2f} % of the limit"
            )
    print("  LinuxCNC limits velocity and acceleration of the axes, not the jerk.")


if __name__ == "__main__":
    main()
