"""The interpreter: blocks in order, one modal state, moves out.

What LinuxCNC does with the same program is the reference. Within a line the order of execution is
LinuxCNC's: feed, dwell, plane, units, path control, distance modes, motion, end of program. So an F
word in the line of a G20 or G21 is still in the old units; a warning says so.

Lengths become metres as they are read. The machine stands at the given start before the first move.

Differences from LinuxCNC
-------------------------
Before the first G61 or G64 pieces are exact stops (LinuxCNC starts in G64 without tolerance).
G64 P0 is G64 without a tolerance, as in LinuxCNC; a negative P or Q is refused (LinuxCNC takes it
as absent). The naive cam detector of G64 Q merges nothing here. P words that a dwell or G64 and an
arc in one line would share are refused, as are an R below 0.00005 inch, more than 10 000 turns and
two signs before a number. A program may end without M2, M30 or %, and comments may stand before
its first %. Lines may have 4096 characters, not 255.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from contourlab.contours.gcode.arcs import ArcPiece, arc_by_center, arc_by_radius, tolerances
from contourlab.contours.gcode.blocks import Block
from contourlab.contours.gcode.lexer import read_words, strip_comments
from contourlab.contours.gcode.modal import PLANES, ModalState, Plane
from contourlab.contours.gcode.recorder import MoveRecorder
from contourlab.contours.part import Ignored, Moves, axis_columns
from contourlab.errors import ConfigurationError, GcodeError, choices

__all__ = ["LARGEST", "MOST_TURNS", "SHORTEST", "Interpretation", "Interpreter"]

SHORTEST = 1e-12
"""A move shorter than this makes no piece [m]; the tool stays where it is."""

LARGEST = 1e4
"""Largest coordinate, radius [m], and feed [m/s]; anything above is a mistake."""

MOST_TURNS = 10_000
"""Largest P of an arc."""

_INCH = 0.0254


@dataclass(frozen=True, kw_only=True)
class Interpretation:
    """What a program does."""

    moves: Moves
    ignored: dict[str, Ignored]
    warnings: tuple[str, ...]
    largest_center_move: float


@dataclass(kw_only=True)
class Interpreter:
    """Reads a program once; make a new one for each program.

    Parameters
    ----------
    name
        Name of the program in messages.
    axes
        Coordinates that may move, among X, Y, Z.
    default_units
        ``"mm"`` or ``"inch"``: units before the first G20 or G21. In LinuxCNC the machine decides.
    block_delete
        Whether lines that start with ``/`` are skipped.
    start
        Where the machine stands before the first move [m].
    most_pieces
        More pieces than this are refused.
    """

    name: str = "program"
    axes: Sequence[str] = ("X", "Y", "Z")
    default_units: str = "mm"
    block_delete: bool = False
    start: Sequence[float | int] = (0.0, 0.0, 0.0)
    most_pieces: int = 5_000_000
    state: ModalState = field(init=False)

    def __post_init__(self) -> None:
        if self.default_units not in ("mm", "inch"):
            raise ConfigurationError(
                f"default_units must be mm or inch, got {self.default_units!r}; "
                + choices(self.default_units, ["mm", "inch"])
            )
        columns = axis_columns(self.axes)
        try:
            x, y, z = (float(value) for value in self.start)
        except (TypeError, ValueError):
            x = y = z = math.nan
        if not all(abs(value) <= LARGEST for value in (x, y, z)):
            raise ConfigurationError(
                f"start must be three coordinates within {LARGEST:g} m, got {self.start!r}"
            )
        self._fixed = tuple(k for k in range(3) if k not in columns)
        self.state = ModalState(position=(x, y, z), inch=self.default_units == "inch")
        self._recorder = MoveRecorder()
        self._ignored: dict[str, list[int]] = {}
        self._warnings: list[str] = []
        self._blend_seen = False
        self._line = 0
        self._center_move = 0.0

    def run(self, lines: Iterable[str]) -> Interpretation:
        """Read the lines of a program to its end.

        Parameters
        ----------
        lines
            Text, without line ends.

        Raises
        ------
        GcodeError
            With name, line and word: anything that this version does not read.
        """
        delimited: bool | None = None
        for self._line, line in enumerate(lines, start=1):
            try:
                code = strip_comments(line)
                if not code:
                    continue
                if code == "%" and delimited is not False:
                    if delimited:
                        break
                    delimited = True
                    continue
                delimited = bool(delimited)
                if code[0] == "/":
                    if self.block_delete:
                        continue
                    code = code[1:]
                block = Block(read_words(code))
                self._execute(block)
            except GcodeError as error:
                raise GcodeError(
                    error.message, file=self.name, line=self._line, word=error.word
                ) from None
            if block.stop:
                break
        return Interpretation(
            moves=self._recorder.moves(),
            ignored={name: Ignored(*seen) for name, seen in self._ignored.items()},
            warnings=tuple(self._warnings),
            largest_center_move=self._center_move,
        )

    # -- one block ----------------------------------------------------------------------------

    def _execute(self, block: Block) -> None:
        state, values, g = self.state, block.values, block.g
        motion = self._motion(block)
        self._check_letters(block, motion)
        for name in block.ignored:
            self._ignore(name)
        for letter in ("S", "T"):
            if letter in values:
                self._ignore(letter)
        if "F" in values:
            self._set_feed(block)
        if g:
            if "dwell" in g:
                self._dwell(block)
            if "plane" in g:
                state.plane = PLANES[g["plane"][0]]
            if "units" in g:
                state.inch = g["units"][0] == 200
            if "path control" in g:
                self._path_control(block)
            if "distance" in g:
                state.absolute = g["distance"][0] == 900
            if "arc distance" in g:
                state.absolute_center = g["arc distance"][0] == 901
            if "motion" in g:
                state.motion = None if g["motion"][0] == 800 else motion
        if motion in (0, 10):
            self._straight(block, motion)
        elif motion in (20, 30):
            self._arc(block, motion)

    def _motion(self, block: Block) -> int | None:
        """Return what this line moves by: its own motion word, or the one in force."""
        values, modal = block.values, self.state.motion
        axis = "X" if "X" in values else "Y" if "Y" in values else "Z" if "Z" in values else None
        if "motion" in block.g:
            own, text = block.g["motion"]
            if own != 800:
                return own
            if axis:
                raise GcodeError(f"axis words cannot stand with {text}", word=block.texts[axis])
            return None
        if axis:
            if modal is None:
                raise GcodeError(
                    "no G0, G1, G2 or G3 is in force to use the word", word=block.texts[axis]
                )
            return modal
        if modal in (20, 30) and ("I" in values or "J" in values or "K" in values):
            return modal
        return None

    def _check_letters(self, block: Block, motion: int | None) -> None:
        """Refuse a letter that nothing in the line uses, and one that two things use."""
        arc = motion in (20, 30)
        users = block.m_letters
        if arc:
            users += "IJKRP"
        if "dwell" in block.g:
            users += "P"
        if block.g.get("path control", (0, ""))[0] == 640:
            users += "PQ"
        for letter, text in block.texts.items():
            if letter in "XYZFST":
                continue
            if letter not in users:
                raise GcodeError("nothing in the line uses the word", word=text)
            if users.count(letter) > 1:
                raise GcodeError("two words of the line would use it", word=text)

    def _ignore(self, name: str) -> None:
        seen = self._ignored.setdefault(name, [self._line, 0])
        seen[1] += 1

    def _set_feed(self, block: Block) -> None:
        state, value = self.state, block.values["F"]
        if value < 0.0:
            raise GcodeError("a feed must be >= 0", word=block.texts["F"])
        state.feed = self._metres(value, block.texts["F"]) / 60.0
        units = block.g.get("units")
        if units is not None and (units[0] == 200) != state.inch:
            self._warnings.append(
                f"{block.texts['F']} at line {self._line}: read in "
                f"{'inch' if state.inch else 'mm'}/min, because LinuxCNC sets the feed before "
                f"the {units[1]} of the same line"
            )

    def _dwell(self, block: Block) -> None:
        if "P" not in block.values:
            raise GcodeError("a dwell needs its time, P in seconds", word=block.g["dwell"][1])
        seconds = block.values["P"]
        if not 0.0 <= seconds <= 1e9:
            raise GcodeError("a dwell must be within 0 to 1e9 s", word=block.texts["P"])
        self._recorder.dwell(seconds)

    def _path_control(self, block: Block) -> None:
        if block.g["path control"][0] != 640:
            self.state.blend = math.nan
            return
        for letter in "PQ":
            if block.values.get(letter, 0.0) < 0.0:
                raise GcodeError("a tolerance must be >= 0", word=block.texts[letter])
        tolerance = self._metres(block.values.get("P", 0.0), block.texts.get("P", ""))
        self.state.blend = tolerance if tolerance > 0.0 else math.inf
        if not self._blend_seen:
            self._blend_seen = True
            self._warnings.append(
                f"G64 at line {self._line}: corners are not blended in this version, "
                "every corner is an exact stop"
            )

    # -- motion -------------------------------------------------------------------------------

    def _metres(self, value: float, word: str) -> float:
        metres = value * _INCH if self.state.inch else value / 1000.0
        if not -LARGEST <= metres <= LARGEST:
            raise GcodeError(f"the number is too large, at most {LARGEST:g} m", word=word)
        return metres

    def _target(self, block: Block) -> tuple[float, float, float]:
        """Return where the line goes [m]."""
        state, values = self.state, block.values
        place = state.position
        x, y, z = place
        absolute = state.absolute
        if "X" in values:
            x = self._metres(values["X"], block.texts["X"]) + (0.0 if absolute else x)
        if "Y" in values:
            y = self._metres(values["Y"], block.texts["Y"]) + (0.0 if absolute else y)
        if "Z" in values:
            z = self._metres(values["Z"], block.texts["Z"]) + (0.0 if absolute else z)
        if not absolute and max(abs(x), abs(y), abs(z)) > LARGEST:
            raise GcodeError(f"the tool goes farther than {LARGEST:g} m")
        if not self._fixed:
            return x, y, z
        target = [x, y, z]
        for k in self._fixed:
            if abs(target[k] - place[k]) > SHORTEST:
                letter = "XYZ"[k]
                raise GcodeError(
                    f"{letter} moves, and the contour was asked for in {', '.join(self.axes)} only",
                    word=block.texts[letter],
                )
            target[k] = place[k]
        return target[0], target[1], target[2]

    def _feed(self, block: Block, motion: int) -> float:
        if self.state.feed <= 0.0:
            word = block.g["motion"][1] if "motion" in block.g else f"G{motion // 10}"
            raise GcodeError("no feed is set: give F before or in the line", word=word)
        return self.state.feed

    def _straight(self, block: Block, motion: int) -> None:
        state = self.state
        feed = math.nan if motion == 0 else self._feed(block, motion)
        start, end = state.position, self._target(block)
        if math.dist(start, end) <= SHORTEST:
            return
        self._recorder.line(start, end, state.plane.normal, self._line, feed, state.blend)
        self._arrive(end)

    def _arc(self, block: Block, motion: int) -> None:
        state, values, plane = self.state, block.values, self.state.plane
        word = block.g["motion"][1] if "motion" in block.g else f"G{motion // 10}"
        centered = "I" in values or "J" in values or "K" in values
        if not centered and "R" not in values:
            raise GcodeError("an arc needs its centre (I, J, K) or its radius (R)", word=word)
        if centered and "R" in values:
            raise GcodeError("an arc takes a centre or a radius, not both", word=block.texts["R"])
        feed = self._feed(block, motion)
        if any(k in self._fixed for k in (plane.first, plane.second)):
            raise GcodeError(
                f"arcs of the plane {plane.name} leave {', '.join(self.axes)}, "
                "in which the contour was asked for",
                word=word,
            )
        start, end = state.position, self._target(block)
        turns = self._turns(block)
        a = start[plane.first], start[plane.second]
        b = end[plane.first], end[plane.second]
        limits = tolerances(state.inch)
        clockwise = motion == 20
        try:
            if centered:
                center = self._center(block, a)
                pieces, moved = arc_by_center(a, b, center, clockwise, turns, limits)
                self._center_move = max(self._center_move, moved)
            else:
                if "XYZ"[plane.first] not in values and "XYZ"[plane.second] not in values:
                    raise GcodeError(f"an arc given by R needs an end in the plane {plane.name}")
                radius = self._metres(values["R"], block.texts["R"])
                pieces = [arc_by_radius(a, b, radius, clockwise, turns, limits)]
        except GcodeError as error:
            if error.word:
                raise
            raise GcodeError(error.message, word=word) from None
        self._record_arc(start, end, pieces, feed)
        self._arrive(end)

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
                center[at] += self._metres(values[letter], block.texts[letter])
            elif state.absolute_center:
                raise GcodeError(f"{letter} is missing: the centre is absolute (G90.1)")
        return center[0], center[1]

    def _record_arc(
        self,
        start: tuple[float, float, float],
        end: tuple[float, float, float],
        pieces: Sequence[ArcPiece],
        feed: float,
    ) -> None:
        state, plane = self.state, self.state.plane
        base, rise = start[plane.normal], end[plane.normal] - start[plane.normal]
        points = [start]
        for piece in pieces[:-1]:
            points.append(_placed(plane, piece.end, base + rise * piece.rise))
        points.append(end)
        for (place, following), piece in zip(pairwise(points), pieces, strict=True):
            center = _placed(plane, piece.center, place[plane.normal])
            self._recorder.arc(
                place, following, center, plane.normal, piece.angle, self._line, feed, state.blend
            )

    def _arrive(self, end: tuple[float, float, float]) -> None:
        self.state.position = end
        if len(self._recorder) > self.most_pieces:
            raise GcodeError(f"the program has more than {self.most_pieces} pieces")


def _placed(plane: Plane, point: tuple[float, float], height: float) -> tuple[float, float, float]:
    place = [0.0, 0.0, 0.0]
    place[plane.first], place[plane.second], place[plane.normal] = *point, height
    return place[0], place[1], place[2]
