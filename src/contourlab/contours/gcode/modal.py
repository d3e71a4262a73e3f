"""The modal state: what stays in force from line to line, and the three planes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

__all__ = ["INCH", "PLANES", "ModalState", "Plane", "SavedState"]

INCH = 0.0254
"""[m]"""


class Plane(NamedTuple):
    """A plane for arcs: its two axes and its normal, right-handed."""

    first: int
    second: int
    normal: int
    first_center: str
    second_center: str
    foreign_center: str
    name: str
    code: int


PLANES = {
    170: Plane(0, 1, 2, "I", "J", "K", "XY (G17)", 170),
    180: Plane(2, 0, 1, "K", "I", "J", "ZX (G18)", 180),
    190: Plane(1, 2, 0, "J", "K", "I", "YZ (G19)", 190),
}


class SavedState(NamedTuple):
    """What M70 and M73 save; the motion word in force is not among it, as in LinuxCNC."""

    inch: bool
    plane: Plane
    absolute: bool
    absolute_center: bool
    inverse_time: bool
    feed: float
    feed_word: float
    blend: float
    merge: float
    retract_to_r: bool
    system: int


@dataclass(slots=True)
class ModalState:
    """What stays in force from line to line."""

    position: tuple[float, float, float]
    """Where the tool is, in the coordinate system in force [m]."""
    machine: tuple[float, float, float]
    """Where the tool is, in machine coordinates [m]."""
    inch: bool
    motion: int | None = None
    """Ten times the number of the motion word in force."""
    plane: Plane = PLANES[170]
    absolute: bool = True
    absolute_center: bool = False
    inverse_time: bool = False
    """Whether F is one over the minutes that each piece takes (G93)."""
    feed: float = 0.0
    """[m/s]; 0 until an F word."""
    feed_word: float = 0.0
    """The feed in the units of the program, per minute."""
    blend: float = math.nan
    """Blend tolerance [m]: NaN exact stop, inf without tolerance."""
    merge: float = math.nan
    """Tolerance within which lines may be merged [m]: NaN for none."""
    retract_to_r: bool = False
    """G98 or G99; nothing here moves by it."""

    def program_units(self, metres: float) -> float:
        """Return a length in the units of the program.

        Parameters
        ----------
        metres
            Length [m].

        Returns
        -------
        float
            Rounded to 15 digits, so that 0.0031 m is 3.1 mm.
        """
        return float(f"{metres / INCH if self.inch else metres * 1000.0:.15g}")

    def save(self, system: int) -> SavedState:
        """Return what M70 saves.

        Parameters
        ----------
        system
            Number of the coordinate system in force.
        """
        return SavedState(
            self.inch, self.plane, self.absolute, self.absolute_center, self.inverse_time,
            self.feed, self.feed_word, self.blend, self.merge, self.retract_to_r, system,
        )  # fmt: skip

    def restore(self, saved: SavedState) -> None:
        """Put back what was saved, except for the coordinate system.

        Parameters
        ----------
        saved
            From :meth:`save`.
        """
        self.inch, self.plane, self.absolute = saved.inch, saved.plane, saved.absolute
        self.absolute_center, self.inverse_time = saved.absolute_center, saved.inverse_time
        self.feed, self.feed_word = saved.feed, saved.feed_word
        self.blend, self.merge, self.retract_to_r = saved.blend, saved.merge, saved.retract_to_r
