"""G5, G5.1, G5.2 and G5.3: splines of the plane XY, as rational Bézier curves.

I, J and P, Q are distances from the start and from the end, in G91 as in G90. G5 may leave I and J
out when a G5 went before it: the handle then is the mirror image of that one's last. Control points
of G5.2 are positions; in G91 they count from where the spline begins. All of this is LinuxCNC's.

Refused although LinuxCNC takes it, because what it then does depends on what was before: a first G5
without I and J; G5.2 that no G5.3 ends, or with other words than X, Y, P, L, F between; Z with
G5.2; a first G5.2 point without its P; splines in inverse time (G93).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.gcode.blocks import Block
from contourlab.contours.gcode.motion import SHORTEST, Motion
from contourlab.contours.gcode.parameters import whole
from contourlab.contours.gcode.splines import is_straight, nurbs_pieces
from contourlab.errors import GcodeError

__all__ = ["HIGHEST_ORDER", "MOST_POINTS", "SplineMotion"]

HIGHEST_ORDER = 12
"""Largest L of a NURBS."""

MOST_POINTS = 100_000
"""Control points of a NURBS."""

_LEAST_ORDER = 3


class SplineMotion:
    """Turns blocks of splines into rows.

    Parameters
    ----------
    motion
        Works out points, and holds the recorder.
    """

    def __init__(self, motion: Motion) -> None:
        self._motion = motion
        self._handle: tuple[float, float] | None = None
        self._points: list[tuple[float, float]] = []
        self._weights: list[float] = []
        self._order = _LEAST_ORDER
        self.open = False
        """Whether a NURBS waits for its G5.3."""

    def interrupt(self) -> None:
        """Forget the handle of the last G5: another move came between."""
        self._handle = None

    def bezier(self, block: Block, motion: int) -> None:
        """Execute G5 or G5.1.

        Parameters
        ----------
        block, motion
            What the line says and moves by.

        Raises
        ------
        GcodeError
            A word is missing, or the curve stands still somewhere.
        """
        word = self._check(block, motion)
        if not {"X", "Y", "@", "^"} & block.values.keys():
            raise GcodeError("a spline needs its end, X or Y", word=word)
        state = self._motion.state
        start = state.position
        end, machine_end = self._motion.target(block)
        first = self._pair(block, "I", "J", word, needed=motion == 51)
        handles = []
        if motion == 51:
            assert first is not None
            handles = [(start[0] + first[0], start[1] + first[1])]
        else:
            last = self._pair(block, "P", "Q", word, needed=True)
            assert last is not None
            if first is None and self._handle is None:
                raise GcodeError("the first of a row of G5 needs I and J", word=word)
            first = first or self._handle or (0.0, 0.0)
            handles = [(start[0] + first[0], start[1] + first[1]),
                       (end[0] + last[0], end[1] + last[1])]  # fmt: skip
            self._handle = -last[0], -last[1]
        feed = self._motion.feed(block, motion, 0.0)
        points = [start, *((x, y, start[2]) for x, y in handles), end]
        control = np.array([(*self._motion.offsets.to_machine(point), 1.0) for point in points])
        control[-1, :3] = machine_end
        self._record(control, feed, word)
        self._motion.arrive(end, machine_end)

    def control_point(self, block: Block, motion: int) -> None:
        """Execute G5.2: the first call begins a NURBS.

        Parameters
        ----------
        block, motion
            What the line says and moves by.

        Raises
        ------
        GcodeError
            A word is missing or too many.
        """
        word = self._check(block, motion)
        self._motion.feed(block, motion, 0.0)
        values, texts = block.values, block.texts
        state = self._motion.state
        placed = bool({"X", "Y", "@", "^"} & values.keys())
        if placed and ("X" in values) != ("Y" in values):
            raise GcodeError("a control point of a NURBS needs X and Y", word=word)
        if "P" in values and not 1e-9 <= values["P"] <= 1e9:
            raise GcodeError("a weight must be > 0, within 1e-9 to 1e9", word=texts["P"])
        if placed and "P" not in values:
            raise GcodeError("a control point of a NURBS needs its weight, P", word=word)
        if not self.open:
            self.open, self._order = True, _LEAST_ORDER
            weight = values["P"] if "P" in values and not placed else 1.0
            self._points, self._weights = [state.position[:2]], [weight]
        elif not placed and "P" in values:
            raise GcodeError("only the first line of a NURBS may have P alone", word=texts["P"])
        if "L" in values:
            order = whole(values["L"]) if abs(values["L"]) <= 1000.0 else 0
            if not 1 <= order <= HIGHEST_ORDER:
                raise GcodeError(
                    f"the order of a NURBS must be within 1 to {HIGHEST_ORDER} "
                    f"(below {_LEAST_ORDER} it is {_LEAST_ORDER})",
                    word=texts["L"],
                )
            self._order = order if order > _LEAST_ORDER else self._order
        if placed:
            here, _ = self._motion.target(block)
            self._points.append(here[:2])
            self._weights.append(values["P"])
            if len(self._points) > MOST_POINTS:
                raise GcodeError(f"a NURBS has at most {MOST_POINTS} control points", word=word)

    def close(self, word: str) -> None:
        """Execute G5.3: the NURBS is run.

        Parameters
        ----------
        word
            As written.

        Raises
        ------
        GcodeError
            No NURBS, or fewer points than its order.
        """
        if not self.open:
            raise GcodeError("there is no G5.2 before it", word=word)
        if len(self._points) < self._order:
            raise GcodeError(
                f"a NURBS of order {self._order} needs {self._order} control points or more, "
                f"got {len(self._points)}",
                word=word,
            )
        self.open = False
        motion, state = self._motion, self._motion.state
        state.motion = None
        height = state.position[2]
        placed = np.array(
            [motion.offsets.to_machine((x, y, height)) for x, y in self._points], dtype=float
        )
        placed[0] = state.machine
        weights = np.array(self._weights)[:, None]
        for piece in nurbs_pieces(np.hstack([placed * weights, weights]), self._order):
            if not len(motion.recorder) % 1000:
                motion.arrive(state.position, state.machine)
            self._record(piece, state.feed, word)
        x, y = self._points[-1]
        end = placed[-1]
        motion.arrive((x, y, height), (float(end[0]), float(end[1]), float(end[2])))

    # -- parts --------------------------------------------------------------------------------

    def _check(self, block: Block, motion: int) -> str:
        word, state = self._motion.word(block, motion), self._motion.state
        if state.plane.code != 170:
            raise GcodeError("splines are those of the plane XY (G17)", word=word)
        if "Z" in block.values:
            raise GcodeError("a spline has no motion in Z", word=block.texts["Z"])
        if state.inverse_time:
            raise GcodeError("splines in inverse time (G93) are not read", word=word)
        return word

    def _pair(
        self, block: Block, one: str, other: str, word: str, *, needed: bool
    ) -> tuple[float, float] | None:
        values, texts = block.values, block.texts
        if one in values and other in values:
            return (
                self._motion.metres(values[one], texts[one]),
                self._motion.metres(values[other], texts[other]),
            )
        if needed or one in values or other in values:
            raise GcodeError(f"the spline needs {one} and {other}", word=word)
        return None

    def _record(self, control: NDArray[Any], feed: float, word: str) -> None:
        motion, state = self._motion, self._motion.state
        points = control[:, :3] / control[:, 3:]
        if np.max(np.abs(points - points[0])) <= SHORTEST:
            return
        x, y, z = (float(value) for value in points[-1])
        end, start = (x, y, z), state.machine
        moved = motion.recorder
        if is_straight(control):
            moved.line(start, end, 2, motion.place, feed, state.blend, state.merge)
        else:
            for handle in (points[1] - points[0], points[-2] - points[-1]):
                if np.max(np.abs(handle)) <= SHORTEST:
                    raise GcodeError(
                        "a handle of the spline has no length, so its direction there is open; "
                        "give it a length, or make the spline a line",
                        word=word,
                    )
            control = control.copy()
            control[0, :3] = np.array(start) * control[0, 3]
            moved.spline(start, end, control, motion.place, feed, state.blend, state.merge)
        state.machine = end
