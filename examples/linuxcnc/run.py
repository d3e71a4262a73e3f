"""A part run in LinuxCNC without a screen, controlled by an exported law, and judged.

The whole of LinuxCNC is at work: its interpreter reads part.ngc, its planner makes the motion, and
in its servo thread the exported controller commands two simulated axes. Every servo period is
logged. Then the log is judged by the exact contour error against the programmed path, and replayed:
the same C, called from Python with the logged inputs, must give the logged commands bit for bit.

    python examples/linuxcnc/run.py [--controller NAME] [--log FILE.csv] [--short-log FILE.csv]

It needs LinuxCNC with its development files (Debian: linuxcnc-uspace, linuxcnc-uspace-dev) and
works as root and as a plain user. Nothing is installed: LinuxCNC runs in namespaces of its own.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

import contourlab as cl
from contourlab.export.linuxcnc_servo import ServoLayer
from contourlab.export.linuxcnc_session import build_component, missing_linuxcnc, run_private
from contourlab.scenarios import read_scenario

HERE = Path(__file__).parent
PREFIX = "contouring"
FILES = ("machine.ini", "machine.hal", "wiring.hal", "execute.py", "part.ngc",
         "simulated_axis.comp")  # fmt: skip
MM = 1e-3


def axes_hal(machine):
    """Return the lines that give the simulated axes the numbers of the scenario's machine."""
    dynamics, friction = machine.dynamics, machine.dynamics.friction
    lines = ["# Written by run.py from the machine of stage.toml."]
    for k, name in enumerate(machine.names):
        values = {
            "mass": dynamics.mass, "viscous": dynamics.viscous, "gain": dynamics.gain,
            "coulomb": friction.coulomb, "breakaway": friction.breakaway,
            "stribeck-velocity": friction.stribeck_velocity,
            "smoothing-velocity": friction.smoothing_velocity,
            "resolution": machine.sensor.resolution,
        }  # fmt: skip
        for key, value in values.items():
            number = float(np.broadcast_to(value, (machine.n_axes,))[k])
            lines.append(f"setp axis-{name.lower()}.{key} {number!r}")
    return "\n".join(lines) + "\n"


def prepare(scenario, controller, work):
    """Export the controller and put everything that LinuxCNC needs into the working folder."""
    print(f"exporting {controller!r} as a HAL component")
    result = cl.export(
        scenario, controller=controller, target="linuxcnc", output=work / "controller",
        prefix=PREFIX, license="GPL",
    )  # fmt: skip
    for warning in result.warnings:
        print("warning:", warning)
    for name in FILES:
        shutil.copy(HERE / name, work / name)
    setup = next(iter(scenario.setups.values()))
    (work / "axes.hal").write_text(axes_hal(setup.machine))
    print("building with halcompile")
    return [
        build_component(work / "controller" / f"{PREFIX}.comp"),
        build_component(work / "simulated_axis.comp"),
    ]


def run_part(work, modules, log):
    """Run the part in LinuxCNC and return what was logged."""
    print("running part.ngc in LinuxCNC")
    session = run_private(
        ["linuxcnc", "machine.ini"],
        modules=modules,
        folder=work,
        timeout=120.0,
        environment={
            "CONTOURLAB_PROGRAM": str(work / "part.ngc"),
            "CONTOURLAB_LOG": str(log),
        },
    )
    if not log.is_file():
        sys.exit(f"no log was written\n{session.stdout}{session.stderr}")
    table = pd.read_csv(log)
    print(f"{len(table)} servo periods logged in {log}")
    return table


def write_short(table, path):
    """Write what a plain log would hold: positions and forces with six decimals, as halsampler."""
    names = [f"{axis} {what}" for what in ("commanded [mm]", "actual [mm]", "force [N]")
             for axis in ("X", "Y")]  # fmt: skip
    short = table.loc[table["running"] == 1, ["time [s]", *names]]
    path.parent.mkdir(parents=True, exist_ok=True)
    short.round(6).to_csv(path, index=False)


def judge(table, contour):
    """Return the log as a recording with the exact contour error against the programmed path."""
    import xarray as xr

    running = table[table["running"] == 1]
    time = running["time [s]"].to_numpy()

    def columns(what):
        return running[[f"{axis} {what}" for axis in ("X", "Y")]].to_numpy()

    commanded, tool = columns("commanded [mm]") * MM, columns("tool [mm]") * MM
    # the planner rounds corners within G64's tolerance: the foot of its point is the place
    place = cl.contours.foot_point(contour, commanded).parameter
    foot = cl.contours.foot_point(contour, tool, near=place)
    metres = {"units": "m"}
    rows = ("time", "axis")
    return cl.Recording(
        xr.Dataset(
            {
                "reference": (rows, commanded, metres),
                "actual": (rows, tool, metres),
                "measured": (rows, columns("actual [mm]") * MM, metres),
                "tracking_error": (rows, commanded - tool, metres),
                "command": (rows, columns("force [N]"), {"units": "N"}),
                "contour_error": (("time",), foot.distance, metres),
                "contour_error_vector": (rows, foot.vector, metres),
                "foot_parameter": (("time",), foot.parameter),
                "status": (("time",), running["status"].to_numpy()),
            },
            coords={"time": ("time", time - time[0], {"units": "s"}), "axis": ["X", "Y"]},
            attrs={"controller": "LinuxCNC", "outcome": "normal"},
        )
    )


def replay(table, folder):
    """Return the largest difference between logged commands and those of the same C in Python."""
    servo = ServoLayer.of_export(folder)
    rows = servo.inputs(len(table), 1e-3)
    for field, what in (
        ("reference_position", "commanded [mm]"),
        ("reference_velocity", "velocity [mm/s]"),
        ("reference_acceleration", "acceleration [mm/s^2]"),
        ("position", "actual [mm]"),
    ):
        rows[field] = table[[f"{axis} {what}" for axis in ("X", "Y")]].to_numpy()
    rows["enable"] = table["enable"]
    out = servo.run(rows)
    logged = table[["X force [N]", "Y force [N]"]].to_numpy()
    return float(np.abs(out["command"] - logged).max()), out


def main():
    """Do it."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--controller", default="cross-coupled", help="of stage.toml")
    options.add_argument("--log", type=Path, help="where to keep the log, a CSV file")
    options.add_argument("--short-log", type=Path, help="where to keep positions and forces only")
    options.add_argument("--work", type=Path, help="folder to work in, kept")
    chosen = options.parse_args()
    missing = missing_linuxcnc()
    if missing:
        sys.exit(f"LinuxCNC cannot be run here: {missing}")
    with tempfile.TemporaryDirectory() as place:
        work = chosen.work.resolve() if chosen.work else Path(place)
        work.mkdir(parents=True, exist_ok=True)
        scenario = read_scenario(HERE / "stage.toml")
        modules = prepare(scenario, chosen.controller, work)
        log = chosen.log.resolve() if chosen.log else work / "log.csv"
        log.unlink(missing_ok=True)
        table = run_part(work, modules, log)
        if chosen.short_log:
            write_short(table, chosen.short_log)
        if (table["fault code"] != 0).any():
            sys.exit(f"the controller stopped with fault {table['fault code'].max()}")
        contour = next(iter(scenario.setups.values())).reference.contour
        metrics = judge(table, contour).metrics
        print("judged against the programmed path:")
        for name in ("contour_error_rms", "contour_error_max", "tracking_error_max"):
            print(f"  {name}: {float(np.max(metrics[name])) * 1e6:.2f} um")
        difference, _ = replay(table, work / "controller")
        print(f"replayed: largest difference to the logged commands {difference:g} N")
        if difference != 0.0:
            sys.exit("the replay is not identical")


if __name__ == "__main__":
    main()
