"""What is remembered on the way through a program: labels, calls, saved modal states."""

from __future__ import annotations

from dataclasses import dataclass

from contourlab.contours.gcode.modal import SavedState
from contourlab.contours.gcode.sources import Source

__all__ = ["Frame", "Label", "Saved"]


@dataclass(slots=True)
class Label:
    """Where a label was met first."""

    kind: str
    source: Source
    line: int
    """Counted from 0."""
    repeats: int = -1
    """Left to a repeat loop; -1 before it begins."""
    done: int = -1
    """What had been done when the loop last began."""


@dataclass(slots=True)
class Frame:
    """A call that is running."""

    name: str
    kind: str
    source: Source
    """Where it was called from."""
    line: int
    """Line to return to, counted from 0."""
    begin: tuple[Source, int] | None
    """Where a subprogram of M98 begins, once that is known."""
    times: int
    """How often M98 still calls it."""
    numbers: tuple[float, ...]
    """#1 to #30 of the caller."""
    call: dict[str, float]
    """Named parameters of the caller."""


@dataclass(slots=True)
class Saved:
    """A modal state saved by M70 or M73."""

    state: SavedState
    valid: bool = True
    """False after M71."""
    restore: bool = False
    """Whether the end of the call restores it (M73)."""
