"""Moves: where a line goes, as a line, an arc or a helix, and how fast.

Points are worked out in the coordinate system of the program and recorded in machine coordinates.
Under a rotated coordinate system the planes of arcs turn with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from contourlab.contours.gcode.arcs import ArcPiece, arc_by_center, arc_by_radius, tolerances
from contourlab.contours.gcode.blocks import Block
from contourlab.contours.gcode.modal import INCH, ModalState, Plane
from contourlab.contours.gcode.offsets import Offsets
from contourlab.contours.gcode.recorder import MoveRecorder, Place
from contourlab.errors import GcodeError

__all__ = ["LARGEST", "MOST_TURNS", "SHORTEST", "Motion"]

SHORTEST = 1e-12
"""A move shorter than this makes no piece [m]; the tool stays where it is."""

LARGEST = 1e4
"""Largest coordinate, radius [m], and feed [m/s]; anything above is a mistake."""

MOST_TURNS = 10_000
"""Largest P of an arc."""

_SLOWEST = 0.1
"""Least feed of a piece timed by G93, in units of the program per minute: LinuxCNC's."""

Point = tuple[float, float, float]


class Motion:
    """Turns blocks that move into rows of a recorder.

    Parameters
    ----------
    state, offsets, recorder
        What is in force, and where rows go.
    axes, fixed
        Names of the coordinates that may move, and numbers of those that may not.
    most_pieces
        More pieces than this are refused.
    """

    def __init__(
        self,
        state: ModalState,
        offsets: Offsets,
        recorder: MoveRecorder,
        axes: Sequence[str],
        fixed: tuple[int, ...],
        most_pieces: int,
    ) -> None:
        self.state, self.offsets, self.recorder = state, offsets, recorder
        self.place = Place(0)
        """Where the line that is executed stands."""
        self.center_move = 0.0
        """The farthest that a centre was moved [m]."""
        self._axes, self._fixed, self._most_pieces = axes, fixed, most_pieces

    # -- numbers ------------------------------------------------------------------------------

    def metres(self, value: float, word: str) -> float:
        """Return a length of the program in metres.

        Parameters
        ----------
        value, word
            Number and word as written.

        Raises
        ------
        GcodeError
            Too large.
        """
        metres = value * INCH if self.state.inch else value / 1000.0
        if not -LARGEST <= metres <= LARGEST:
            raise GcodeError(f"the number is too large, at most {LARGEST:g} m", word=word)
        return metres

    def lengths(self, block: Block) -> dict[int, float]:
        """Return the coordinates that a block gives, by axis [m].

        Parameters
        ----------
        block
            What the line says.
        """
        return {
            axis: self.metres(block.values[letter], block.texts[letter])
            for axis, letter in enumerate("XYZ")
            if letter in block.values
        }

    def target(self, block: Block) -> tuple[Point, Point]:
        """Return where a line goes, in program and in machine coordinates [m].

        Parameters
        ----------
        block
            What the line says.

        Raises
        ------
        GcodeError
            Too far, or out of the coordinates asked for.
        """
        state, values = self.state, block.values
        if block.g and block.g.get("non-modal", (0, ""))[0] == 530:
            machine = list(state.machine)
            for axis, value in self.lengths(block).items():
                machine[axis] = value
            there = machine[0], machine[1], machine[2]
            here = there if self.offsets.plain else self.offsets.to_program(there)
        else:
            x, y, z = state.position
            absolute = state.absolute
            if "X" in values:
                x = self.metres(values["X"], block.texts["X"]) + (0.0 if absolute else x)
            if "Y" in values:
                y = self.metres(values["Y"], block.texts["Y"]) + (0.0 if absolute else y)
            if "@" in values or "^" in values:
                x, y = self._polar(block, x, y)
            if "Z" in values:
                z = self.metres(values["Z"], block.texts["Z"]) + (0.0 if absolute else z)
            here = x, y, z
            if self.offsets.plain:
                there = here
                if absolute and not self._fixed:
                    return here, there
            else:
                there = self.offsets.to_machine(here)
        if max(abs(there[0]), abs(there[1]), abs(there[2])) > LARGEST:
            raise GcodeError(f"the tool goes farther than {LARGEST:g} m")
        return self._kept(block, here, there) if self._fixed else (here, there)

    def _kept(self, block: Block, here: Point, there: Point) -> tuple[Point, Point]:
        """Refuse motion in the other coordinates; rounding in them is dropped."""
        before = self.state.machine
        kept, own = list(there), list(here)
        for k in self._fixed:
            if abs(there[k] - before[k]) > SHORTEST:
                letter = "XYZ"[k]
                raise GcodeError(
                    f"{letter} moves, and the contour was asked for in {', '.join(self._axes)} "
                    "only",
                    word=block.texts.get(letter, ""),
                )
            kept[k] = before[k]
            if self.offsets.plain:
                own[k] = before[k]
        return (own[0], own[1], own[2]), (kept[0], kept[1], kept[2])

    def _polar(self, block: Block, x: float, y: float) -> tuple[float, float]:
        """Return X and Y of a point given by radius @ and angle ^."""
        state, values, texts = self.state, block.values, block.texts
        word = texts.get("@") or texts["^"]
        if "X" in values or "Y" in values:
            raise GcodeError("X and Y cannot stand with polar coordinates", word=word)
        if (not state.absolute or "^" not in values) and x == 0.0 and y == 0.0:
            raise GcodeError("at the origin the angle ^ is not known", word=word)
        radius, angle = math.hypot(x, y), math.atan2(y, x)
        if "@" in values:
            given = self.metres(values["@"], texts["@"])
            radius = given if state.absolute else radius + given
        if "^" in values:
            given = math.radians(values["^"])
            angle = given if state.absolute else angle + given
        return radius * math.cos(angle), radius * math.sin(angle)

    # -- feed ---------------------------------------------------------------------------------

    def feed(self, block: Block, motion: int, length: float) -> float:
        """Return the feed of a piece [m/s].

        Parameters
        ----------
        block, motion
            What the line says and moves by.
        length
            Length of what one line makes [m].

        Raises
        ------
        GcodeError
            No feed is set; in G93, the line has no F.
        """
        if self.state.inverse_time:
            if "F" not in block.values:
                raise GcodeError(
                    "in G93 every line that cuts needs its F", word=self.word(block, motion)
                )
            per_minute = max(
                length * block.values["F"], _SLOWEST * (INCH if self.state.inch else 1e-3)
            )
            if per_minute > 60.0 * LARGEST:
                raise GcodeError("the feed is too large", word=block.texts["F"])
            return per_minute / 60.0
        if self.state.feed <= 0.0:
            raise GcodeError(
                "no feed is set: give F before or in the line", word=self.word(block, motion)
            )
        return self.state.feed

    @staticmethod
    def word(block: Block, motion: int) -> str:
        """Return the word that a line moves by, for messages.

        Parameters
        ----------
        block, motion
            What the line says and moves by.
        """
        if "motion" in block.g:
            return block.g["motion"][1]
        return f"G{motion // 10}" + (f".{motion % 10}" if motion % 10 else "")

    # -- pieces -------------------------------------------------------------------------------

    def straight(self, block: Block, motion: int) -> None:
        """Execute G0 or G1.

        Parameters
        ----------
        block, motion
            What the line says and moves by.
        """
        state = self.state
        if motion == 0:
            feed = math.nan
        elif not state.inverse_time:
            feed = self.feed(block, motion, 0.0)
        start = state.machine
        here, end = self.target(block)
        length = math.dist(start, end)
        if motion == 10 and state.inverse_time:
            feed = self.feed(block, motion, length)
        if length <= SHORTEST:
            return
        self.recorder.line(
            start, end, state.plane.normal, self.place, feed, state.blend, state.merge
        )
        self.arrive(here, end)

    def arc(self, block: Block, motion: int) -> None:
        """Execute G2 or G3.

        Parameters
        ----------
        block, motion
            What the line says and moves by.
        """
        state, values, plane = self.state, block.values, self.state.plane
        word = self.word(block, motion)
        centered = "I" in values or "J" in values or "K" in values
        if not centered and "R" not in values:
            raise GcodeError("an arc needs its centre (I, J, K) or its radius (R)", word=word)
        if centered and "R" in values:
            raise GcodeError("an arc takes a centre or a radius, not both", word=block.texts["R"])
        self.feed(block, motion, 0.0)
        turned = plane.normal != 2 and self.offsets.turned != (1.0, 0.0)
        if self._fixed and (turned or any(k in self._fixed for k in (plane.first, plane.second))):
            raise GcodeError(
                f"arcs of the plane {plane.name} leave {', '.join(self._axes)}, "
                "in which the contour was asked for",
                word=word,
            )
        start = state.position
        end, machine_end = self.target(block)
        turns = self._turns(block)
        a = start[plane.first], start[plane.second]
        b = end[plane.first], end[plane.second]
        limits = tolerances(state.inch)
        clockwise = motion == 20
        try:
            if centered:
                center = self._center(block, a)
                pieces, moved = arc_by_center(a, b, center, clockwise, turns, limits)
                self.center_move = max(self.center_move, moved)
            else:
                named = {"XYZ"[plane.first], "XYZ"[plane.second], "@", "^"}
                if not named & values.keys():
                    raise GcodeError(f"an arc given by R needs an end in the plane {plane.name}")
                radius = self.metres(values["R"], block.texts["R"])
                pieces = [arc_by_radius(a, b, radius, clockwise, turns, limits)]
        except GcodeError as error:
            if error.word:
                raise
            raise GcodeError(error.message, word=word) from None
        feed = self.feed(block, motion, self._arc_length(a, pieces, start, end))
        self._record_arc(start, end, machine_end, pieces, feed)
        self.arrive(end, machine_end)

    def arrive(self, position: Point, machine: Point) -> None:
        """Let the tool be at the end of a piece.

        Parameters
        ----------
        position, machine
            Program and machine coordinates [m].

        Raises
        ------
        GcodeError
            More pieces than allowed.
        """
        self.state.position, self.state.machine = position, machine
        if len(self.recorder) > self._most_pieces:
            raise GcodeError(f"the program has more than {self._most_pieces} pieces")

    def _turns(self, block: Block) -> int:
        if "P" not in block.values:
            return 1
        value = block.values["P"]
        if not 0.999 <= value <= MOST_TURNS or abs(value - round(value)) > 0.001:
            raise GcodeError(
                f"the turns of an arc must be a whole number from 1 to {MOST_TURNS}",
                word=block.texts["P"],
            )
        return round(value)

    def _center(self, block: Block, start: tuple[float, float]) -> tuple[float, float]:
        state, values, plane = self.state, block.values, self.state.plane
        if plane.foreign_center in values:
            raise GcodeError(
                f"the word does not belong to arcs of the plane {plane.name}",
                word=block.texts[plane.foreign_center],
            )
        center = list((0.0, 0.0) if state.absolute_center else start)
        for at, letter in enumerate((plane.first_center, plane.second_center)):
            if letter in values:
                center[at] += self.metres(values[letter], block.texts[letter])
            elif state.absolute_center:
                raise GcodeError(f"{letter} is missing: the centre is absolute (G90.1)")
        return center[0], center[1]

    def _arc_length(
        self, start: tuple[float, float], pieces: Sequence[ArcPiece], here: Point, there: Point
    ) -> float:
        if not self.state.inverse_time:
            return 0.0
        swept, before = 0.0, start
        for piece in pieces:
            swept += math.dist(before, piece.center) * abs(piece.angle)
            before = piece.end
        normal = self.state.plane.normal
        return math.hypot(swept, there[normal] - here[normal])

    def _record_arc(
        self, start: Point, end: Point, machine_end: Point, pieces: Sequence[ArcPiece], feed: float
    ) -> None:
        state, plane, offsets = self.state, self.state.plane, self.offsets
        base, rise = start[plane.normal], end[plane.normal] - start[plane.normal]
        points = [start]
        for piece in pieces[:-1]:
            points.append(_placed(plane, piece.end, base + rise * piece.rise))
        points.append(end)
        centers = [
            _placed(plane, piece.center, place[plane.normal])
            for place, piece in zip(points, pieces, strict=False)
        ]
        tilted = None
        if not offsets.plain:
            centers = [offsets.to_machine(center) for center in centers]
            points = [offsets.to_machine(point) for point in points]
            cosine, sine = offsets.turned
            if plane.normal != 2 and (cosine, sine) != (1.0, 0.0):
                tilted = (cosine, sine, 0.0) if plane.normal == 0 else (-sine, cosine, 0.0)
        points[0], points[-1] = state.machine, machine_end
        for (place, following), center, piece in zip(
            pairwise(points), centers, pieces, strict=True
        ):
            self.recorder.arc(
                place, following, center, plane.normal, piece.angle, self.place, feed,
                state.blend, state.merge, tilted,
            )  # fmt: skip


def _placed(plane: Plane, point: tuple[float, float], height: float) -> Point:
    place = [0.0, 0.0, 0.0]
    place[plane.first], place[plane.second], place[plane.normal] = *point, height
    return place[0], place[1], place[2]
