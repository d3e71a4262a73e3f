"""The modal state: what stays in force from line to line, and the three planes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

__all__ = ["PLANES", "ModalState", "Plane"]


class Plane(NamedTuple):
    """A plane for arcs: its two axes and its normal, right-handed."""

    first: int
    second: int
    normal: int
    first_center: str
    second_center: str
    foreign_center: str
    name: str


PLANES = {
    170: Plane(0, 1, 2, "I", "J", "K", "XY (G17)"),
    180: Plane(2, 0, 1, "K", "I", "J", "ZX (G18)"),
    190: Plane(1, 2, 0, "J", "K", "I", "YZ (G19)"),
}


@dataclass(slots=True)
class ModalState:
    """What stays in force from line to line."""

    position: tuple[float, float, float]
    """Where the tool is [m]."""
    inch: bool
    motion: int | None = None
    """Ten times the number of the motion word in force."""
    plane: Plane = PLANES[170]
    absolute: bool = True
    absolute_center: bool = False
    feed: float = 0.0
    """[m/s]; 0 until an F word."""
    blend: float = math.nan
    """Blend tolerance [m]: NaN exact stop, inf without tolerance."""
