"""The log of a LinuxCNC run: judged against its part, its error explained, its axes identified.

``examples/linuxcnc/run.py`` let LinuxCNC run ``part.ngc`` without a screen: its interpreter and its
planner moved two simulated axes through an exported PID, and every servo period was logged. So the
log is a real controller's and its machine is known: five and three kilograms, friction that rises
below 5 mm/s. The same from the command line:

    contourlab evaluate examples/linuxcnc/logs/cam_plate.csv --measured motor \
        --contour examples/linuxcnc/part.ngc --output judged
    contourlab identify examples/linuxcnc/logs/cam_plate.csv --output machine.toml

What this log can tell: where the tool left the part, that friction made most of it, and the masses,
viscous and dry friction of both axes. What it cannot: the position was read on the motor, so that
lost motion, pitch and squareness are not in it; one run of 2.4 s says nothing of how often it would
come out like that; and mass is mass over input gain, here 1 N for a command of 1.
"""

from pathlib import Path

import contourlab as cl

folder = Path(__file__).parent / "linuxcnc"
log = folder / "logs" / "cam_plate.csv"

judged = cl.evaluate(log, contour=folder / "part.ngc", measured="motor")
print(f"contour error {1e6 * judged.metrics['contour_error_rms']:.2f} um rms")
for place in judged.worst[:3]:
    where = place.where.rsplit("/", 1)[-1]
    print(f"  {1e6 * abs(place.error):.1f} um at {where}: {place.cause}")
for cause in judged.causes:
    if cause.state == "found" and abs(cause.share) > 0.01:
        print(f"{cause.name}: {100 * cause.share:.0f} % of the mean square")
unseen = [cause.name for cause in judged.causes if cause.state == "unobservable"]
print("not in this log:", ", ".join(unseen))

recording = cl.logs.read_log(log, command="X force [N],Y force [N]").recording()
found = cl.identification.identify_machine(recording, source=log.name)
print(found)
true = cl.machines.linear_motor_stage()  # whose numbers run.py gave to the axes of LinuxCNC
for k, axis in enumerate(found.axes):
    print(f"{axis.axis}: {true.dynamics.mass[k]} kg and {true.dynamics.viscous[k]} N s/m are true")

# what was found is a machine of the library: write_machine_file(machine, "machine.toml")
machine = cl.identification.identified_machine(found)
print("assumed:", *machine.assumed, sep="\n  ")
