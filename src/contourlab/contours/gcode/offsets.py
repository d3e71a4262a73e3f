"""Coordinate systems: where a program's coordinates lie in the machine's.

With a point p in the coordinate system in force, the shift s of G92 and G52, the rotation R of the
coordinate system about Z and its origin o, the machine stands at R (p + s) + o. The nine systems
(G54 to G59.3) live in parameters #5221 to #5390 and G92 in #5210 to #5219, as in LinuxCNC, in the
machine's units. All are zero when a program begins.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from contourlab.contours.gcode.modal import INCH
from contourlab.contours.gcode.parameters import Parameters, whole
from contourlab.errors import GcodeError

__all__ = ["Offsets"]

Point = tuple[float, float, float]

_TABLE = 5201
_G92 = 5210
_ZERO = (0.0, 0.0, 0.0)


class Offsets:
    """The coordinate systems.

    Parameters
    ----------
    inch
        Whether the machine's units are inches.
    """

    def __init__(self, *, inch: bool) -> None:
        self.parameters: Parameters
        """Set before use; they hold the tables."""
        self.system = 1
        """1 is G54, 9 is G59.3."""
        self.origin: Point = _ZERO
        """Origin of the system in force [m]."""
        self.rotation = 0.0
        """Rotation of the system in force about Z [degrees]."""
        self.shift: Point = _ZERO
        """Shift of G92 and G52 [m]."""
        self.plain = True
        """Whether program coordinates are machine coordinates."""
        self._cosine, self._sine = 1.0, 0.0
        self._inch = inch

    @property
    def turned(self) -> tuple[float, float]:
        """Cosine and sine of the rotation; (1, 0) for none."""
        return self._cosine, self._sine

    def to_machine(self, point: Point) -> Point:
        """Return where a point of the program lies in the machine.

        Parameters
        ----------
        point
            [m]
        """
        x, y, z = (a + b for a, b in zip(point, self.shift, strict=True))
        c, s = self._cosine, self._sine
        a, b, h = self.origin
        return c * x - s * y + a, s * x + c * y + b, z + h

    def to_program(self, point: Point) -> Point:
        """Return where a point of the machine lies in the program.

        Parameters
        ----------
        point
            [m]
        """
        return self._in_system(point, self.origin, self._cosine, self._sine, self.shift)

    def select(self, system: int) -> None:
        """Change to another coordinate system.

        Parameters
        ----------
        system
            1 to 9.
        """
        self.system = system
        self.parameters.numbers[5220] = float(system)
        self._load()

    def shift_by(self, code: int, words: Mapping[int, float], position: Point) -> None:
        """Do what G52, G92, G92.1, G92.2 and G92.3 do.

        Parameters
        ----------
        code
            Ten times the number of the word.
        words
            Coordinates given, by axis [m].
        position
            Where the tool is, in program coordinates [m].
        """
        numbers = self.parameters.numbers
        if code in (520, 920):
            shift = list(self.shift)
            for axis, value in words.items():
                # G92: the tool stands at the value from now on; G52: the shift is the value
                shift[axis] = value if code == 520 else position[axis] + shift[axis] - value
            self.shift = (shift[0], shift[1], shift[2])
            numbers[_G92] = 1.0
            for axis in range(3):
                numbers[_G92 + 1 + axis] = self._units(self.shift[axis])
        elif code == 923:
            numbers[_G92] = 1.0
            x, y, z = (self._metres(numbers.get(_G92 + 1 + axis, 0.0)) for axis in range(3))
            self.shift = (x, y, z)
        else:
            numbers[_G92] = 0.0
            self.shift = _ZERO
            if code == 921:
                for number in range(_G92 + 1, _G92 + 10):
                    numbers[number] = 0.0
        self._settle()

    def set_system(
        self,
        level: int,
        number: float,
        words: Mapping[int, float],
        rotation: float | None,
        machine: Point,
    ) -> None:
        """Do what G10 L2 and L20 do.

        Parameters
        ----------
        level
            L: 2 gives the origin, 20 what the coordinates of the tool shall be.
        number
            P: which system, 0 for the one in force.
        words
            Coordinates given, by axis [m].
        rotation
            R [degrees], or None.
        machine
            Where the tool is [m].

        Raises
        ------
        GcodeError
            No such system, or a rotation under a shift.
        """
        if abs(number) > 100.0:
            raise GcodeError("P must be a whole number from 0 to 9")
        system = whole(number)
        if not 0 <= system <= 9:
            raise GcodeError("P must be a whole number from 0 to 9")
        system = system or self.system
        numbers, table = self.parameters.numbers, _TABLE + 20 * system
        if level == 20:
            origin, turn = self._table(system)
            cosine, sine = _direction(turn)
            shift = self.shift if system == self.system else self._stored_shift()
            here = list(self._in_system(machine, origin, cosine, sine, shift))
            before = here.copy()
            for axis, value in words.items():
                here[axis] = value
            dx, dy = before[0] - here[0], before[1] - here[1]
            moved = (cosine * dx - sine * dy, sine * dx + cosine * dy, before[2] - here[2])
            if 0 in words or 1 in words:
                for axis in (0, 1):
                    numbers[table + axis] = self._units(origin[axis] + moved[axis])
            if 2 in words:
                numbers[table + 2] = self._units(origin[2] + moved[2])
        else:
            if rotation is not None:
                self._check_turn(system, rotation)
            for axis, value in words.items():
                numbers[table + axis] = self._units(value)
            if rotation is not None:
                numbers[table + 9] = rotation
        if system == self.system:
            self._load()

    def _check_turn(self, system: int, rotation: float) -> None:
        turns = system == self.system and rotation != self.rotation
        if turns and self.shift[:2] != (0.0, 0.0):
            raise GcodeError(
                "G10 turns the coordinate system in force while G92 or G52 shifts it: LinuxCNC "
                "loses the position then; cancel the shift first (G92.1)"
            )

    def _load(self) -> None:
        self.origin, self.rotation = self._table(self.system)
        self._settle()

    def _settle(self) -> None:
        self._cosine, self._sine = _direction(self.rotation)
        self.plain = (
            self.origin == _ZERO and self.shift == _ZERO and (self._cosine, self._sine) == (1, 0)
        )

    def _table(self, system: int) -> tuple[Point, float]:
        numbers, table = self.parameters.numbers, _TABLE + 20 * system
        x, y, z = (self._metres(numbers.get(table + axis, 0.0)) for axis in range(3))
        return (x, y, z), numbers.get(table + 9, 0.0)

    def _stored_shift(self) -> Point:
        numbers = self.parameters.numbers
        if not numbers.get(_G92, 0.0):
            return _ZERO
        x, y, z = (self._metres(numbers.get(_G92 + 1 + axis, 0.0)) for axis in range(3))
        return x, y, z

    def _metres(self, value: float) -> float:
        metres = value * INCH if self._inch else value / 1000.0
        if not abs(metres) <= 1e4:
            raise GcodeError("an offset is farther than 10000 m")
        return metres

    def _units(self, metres: float) -> float:
        return float(f"{metres / INCH if self._inch else metres * 1000.0:.15g}")

    @staticmethod
    def _in_system(point: Point, origin: Point, cosine: float, sine: float, shift: Point) -> Point:
        x, y, z = (a - b for a, b in zip(point, origin, strict=True))
        return (
            cosine * x + sine * y - shift[0], cosine * y - sine * x - shift[1], z - shift[2],
        )  # fmt: skip


def _direction(degrees: float) -> tuple[float, float]:
    """Return cosine and sine, exact for quarters of a turn."""
    quarters = degrees / 90.0
    if quarters == math.floor(quarters):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters % 4.0)]
    angle = math.radians(degrees)
    return math.cos(angle), math.sin(angle)
