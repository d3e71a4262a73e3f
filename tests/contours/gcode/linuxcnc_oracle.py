"""Runs under LinuxCNC's own Python: interprets a program and prints what it does, as JSON.

Usage: python3 linuxcnc_oracle.py PROGRAM. The last line of the output is one object: ``moves`` is a
list of [kind, source line, feed, x, y, z, ...] in machine coordinates, in mm and mm/min (kind "G0",
"G1" or "arc"; for an arc also its centre, turns and normal axis), ``refused`` the message or null.
G5 splines come as LinuxCNC flattens them, with full doubles.
"""

import json
import math
import sys
import tempfile
from pathlib import Path

INCH = 25.4


class Canon:
    def __init__(self):
        self.moves = []
        self.line = 0
        self.origin = [0.0] * 3
        self.shift = [0.0] * 3
        self.rotation = 0.0
        self.plane = 1
        self.feed = 0.0

    def machine(self, x, y, z):
        """The module gives inches, in the coordinate system in force."""
        x, y, z = x + self.shift[0], y + self.shift[1], z + self.shift[2]
        c, s = math.cos(self.rotation), math.sin(self.rotation)
        x, y = c * x - s * y, s * x + c * y
        o = self.origin
        return [(x + o[0]) * INCH, (y + o[1]) * INCH, (z + o[2]) * INCH]

    def next_line(self, state):
        self.line = state.sequence_number

    def set_g5x_offset(self, index, x, y, z, *others):
        self.origin = [x, y, z]

    def set_g92_offset(self, x, y, z, *others):
        self.shift = [x, y, z]

    def set_xy_rotation(self, degrees):
        self.rotation = math.radians(degrees)

    def set_plane(self, plane):
        self.plane = plane

    def set_feed_rate(self, rate):
        self.feed = rate * INCH

    def straight_traverse(self, x, y, z, *others):
        self.moves.append(["G0", self.line, self.feed, *self.machine(x, y, z)])

    def straight_feed(self, x, y, z, *others):
        self.moves.append(["G1", self.line, self.feed, *self.machine(x, y, z)])

    def arc_feed(self, end1, end2, centre1, centre2, turns, end3, *others):
        first, second, normal = {1: (0, 1, 2), 3: (2, 0, 1), 2: (1, 2, 0)}[self.plane]
        end, centre = [0.0] * 3, [0.0] * 3
        end[first], end[second], end[normal] = end1, end2, end3
        centre[first], centre[second], centre[normal] = centre1, centre2, end3
        self.moves.append(
            [
                "arc",
                self.line,
                self.feed,
                *self.machine(*end),
                *self.machine(*centre),
                turns,
                normal,
            ]
        )

    def get_external_length_units(self):
        return 1.0 / INCH  # the machine is in inches, as the module begins

    def get_external_angular_units(self):
        return 1.0

    def get_axis_mask(self):
        return 7

    def get_block_delete(self):
        return False

    def get_tool(self, pocket):
        return -1, *[0.0] * 12, 0

    def check_abort(self):
        return False

    def __getattr__(self, name):
        if name.startswith("_"):
            raise AttributeError(name)
        return lambda *arguments: None


def main():
    import gcode

    canon = Canon()
    refused = None
    with tempfile.TemporaryDirectory() as folder:
        canon.parameter_file = str(Path(folder) / "parameters.var")
        numbers = [*range(5161, 5170), *range(5181, 5190), *range(5210, 5391)]
        text = "".join(f"{n} {float(n == 5220)}\n" for n in numbers)
        Path(canon.parameter_file).write_text(text)
        try:
            result, line = gcode.parse(sys.argv[1], canon, "", "")
            if result > gcode.MIN_ERROR:
                refused = f"{line}: {gcode.strerror(result)}"
        except Exception as error:  # noqa: BLE001 - whatever the module raises is a refusal
            refused = str(error)
    print()
    print(json.dumps({"moves": canon.moves, "refused": refused}))


main()
