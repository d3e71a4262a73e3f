"""One block: modes, feed, dwells, offsets, moves, in LinuxCNC's order.

Within a line: what M70 to M73 save or restore is done after the feed mode and the feed; then come
dwell, plane, units, coordinate system, path control, distance modes, offsets (G10, G52, G92) and
G5.3, motion, end of program. So an F word in the line of a G20 or G21 is still in the old units; a
warning says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from contourlab.contours.gcode.blocks import Block
from contourlab.contours.gcode.control import Flow
from contourlab.contours.gcode.modal import INCH, PLANES, SavedState
from contourlab.contours.gcode.motion import Motion
from contourlab.contours.gcode.spline_motion import SplineMotion
from contourlab.errors import GcodeError

__all__ = ["Executor"]

_SYSTEMS = {540: 1, 550: 2, 560: 3, 570: 4, 580: 5, 590: 6, 591: 7, 592: 8, 593: 9}
_TAKES_AXES = frozenset((100, 520, 920))
_LETTERS = {20: "IJKRP", 30: "IJKRP", 50: "IJPQ", 51: "IJ", 52: "PL"}
_NO_LETTERS = ""


class Executor:
    """Executes blocks.

    Parameters
    ----------
    motion, flow
        Where the tool is and moves; where the program is.
    ignore, warn
        Called with words that do not move the tool, and with warnings.
    """

    def __init__(
        self,
        motion: Motion,
        flow: Flow,
        ignore: Callable[[str], None],
        warn: Callable[[str], None],
    ) -> None:
        self._motion, self._flow = motion, flow
        self._state, self._offsets = motion.state, motion.offsets
        self._splines = SplineMotion(motion)
        self._ignore, self._warn = ignore, warn
        self._lengths_told = False

    def execute(self, block: Block) -> None:
        """Execute one block.

        Parameters
        ----------
        block
            What the line says.

        Raises
        ------
        GcodeError
            With the word: whatever is refused.
        """
        state, values, g = self._state, block.values, block.g
        motion = self._motion_of(block)
        if block.texts:
            self._check_letters(block, motion)
        if self._splines.open and (g or block.context or block.stop or values.keys() - {"F", "S"}):
            self._check_open(block, motion)
        for name in block.ignored:
            self._ignore(name)
        if "S" in values or "T" in values or "$" in values:
            for letter in "ST$":
                if letter in values:
                    self._ignore(letter)
        if g and "feed mode" in g:
            self._feed_mode(g["feed mode"][0] == 930)
        if "F" in values:
            self._set_feed(block)
        if block.context:
            self._context(block.context)
        if g:
            self._modes(block, motion)
        if motion is None:
            return
        if motion == 10 or motion == 0:
            self._motion.straight(block, motion)
        elif motion == 20 or motion == 30:
            self._motion.arc(block, motion)
        elif motion == 52:
            self._splines.control_point(block, motion)
            state.motion = 52
            return
        elif motion != 800:
            self._splines.bezier(block, motion)
            return
        self._splines.interrupt()

    def check_end(self) -> None:
        """Refuse a program that ends in the middle of a NURBS.

        Raises
        ------
        GcodeError
            G5.3 is missing.
        """
        if self._splines.open:
            raise GcodeError("the program ends before the G5.3 that closes the NURBS of G5.2")

    def restore(self, saved: SavedState) -> None:
        """Put back a modal state (M72, or the end of a call after M73).

        Parameters
        ----------
        saved
            What M70 or M73 saved.
        """
        state = self._state
        state.restore(saved)
        if saved.system != self._offsets.system:
            self._offsets.select(saved.system)
            self._placed()

    # -- what a line means ----------------------------------------------------------------------

    def _motion_of(self, block: Block) -> int | None:
        """Return what this line moves by: its own motion word, or the one in force."""
        values, modal, g = block.values, self._state.motion, block.g
        axis = "X" if "X" in values else "Y" if "Y" in values else "Z" if "Z" in values else None
        if axis is None and ("@" in values or "^" in values):
            axis = "@" if "@" in values else "^"
            if self._state.plane.code != 170:
                # LinuxCNC asks for the plane that was in force before the line
                raise GcodeError(
                    "polar coordinates are those of the plane XY (G17)", word=block.texts[axis]
                )
        if g:
            other, text = g.get("non-modal", (0, ""))
            if "motion" in g:
                own, own_text = g["motion"]
                if other in _TAKES_AXES and own != 800:
                    raise GcodeError(
                        f"the line has {text} already, which takes axes", word=own_text
                    )
                if own != 800:
                    return own
                if axis and other not in _TAKES_AXES:
                    raise GcodeError(
                        f"axis words cannot stand with {own_text}", word=block.texts[axis]
                    )
                return None
            if other in _TAKES_AXES:
                return None
            if other == 530 and axis is None and modal not in (0, 10):
                raise GcodeError("machine coordinates need G0 or G1", word=text)
        if axis:
            if modal is None:
                raise GcodeError(
                    "no G0, G1, G2 or G3 is in force to use the word", word=block.texts[axis]
                )
            return modal
        if (modal == 20 or modal == 30) and ("I" in values or "J" in values or "K" in values):
            return modal
        return None

    def _check_letters(self, block: Block, motion: int | None) -> None:
        """Refuse a letter that nothing in the line uses, and one that two things use."""
        users = block.m_letters
        if motion is not None:
            users += _LETTERS.get(motion, _NO_LETTERS)
        if block.g:
            other = block.g.get("non-modal", (0, ""))[0]
            if other == 40:
                users += "P"
            elif other == 100:
                users += "PLR"
            if block.g.get("path control", (0, ""))[0] == 640:
                users += "PQ"
        for letter, text in block.texts.items():
            if letter in "XYZFST@^$":
                continue
            if letter not in users:
                raise GcodeError("nothing in the line uses the word", word=text)
            if users.count(letter) > 1:
                raise GcodeError("two words of the line would use it", word=text)

    def _check_open(self, block: Block, motion: int | None) -> None:
        """Between G5.2 and G5.3 nothing else may stand: LinuxCNC would drop the points."""
        for group, (code, text) in block.g.items():
            if (group, code) not in (("motion", 52), ("non-modal", 53)):
                raise GcodeError("between G5.2 and G5.3 only G5.2 may stand", word=text)
        if block.context or block.stop or motion not in (52, None):
            raise GcodeError("the NURBS of G5.2 is not closed by G5.3")

    # -- modes ----------------------------------------------------------------------------------

    def _tool_length(self, word: str) -> None:
        """There is no tool table: the path is that of the tool tip, which is what is cut."""
        if not self._lengths_told:
            self._lengths_told = True
            self._warn(f"{word}: tool lengths are not known, the path is that of the tool's tip")

    def _modes(self, block: Block, motion: int | None) -> None:
        state, g = self._state, block.g
        other, text = g.get("non-modal", (0, ""))
        if other == 40:
            self._dwell(block)
        elif other == 530:
            self._check_machine_coordinates(block, motion, text)
        if g.get("tool length", (0, ""))[0] == 430:
            self._tool_length(g["tool length"][1])
        if "plane" in g:
            state.plane = PLANES[g["plane"][0]]
        if "units" in g:
            self._units(g["units"][0] == 200)
        if "coordinate system" in g:
            system = _SYSTEMS[g["coordinate system"][0]]
            if system != self._offsets.system:
                self._offsets.select(system)
                self._placed()
        if "path control" in g:
            self._path_control(block)
        if "distance" in g:
            state.absolute = g["distance"][0] == 900
        if "arc distance" in g:
            state.absolute_center = g["arc distance"][0] == 901
        if "retract" in g:
            state.retract_to_r = g["retract"][0] == 980
        if "spindle mode" in g and g["spindle mode"][0] == 960 and "S" not in block.values:
            raise GcodeError("a constant cutting speed needs S", word=g["spindle mode"][1])
        if other == 100:
            self._set_system(block, text)
        elif other in (520, 920):
            self._shift(block, other, text)
        elif other == 53:
            self._splines.close(text)
        if "offset in force" in g:
            self._shift(block, *g["offset in force"])
        if "motion" in g:
            own = g["motion"][0]
            # LinuxCNC does not keep G5 and G5.1 for the lines that follow
            if own not in (50, 51, 52):
                state.motion = None if own == 800 else own

    def _feed_mode(self, inverse: bool) -> None:
        state = self._state
        if state.inverse_time and not inverse:
            state.feed = state.feed_word = 0.0
        state.inverse_time = inverse

    def _set_feed(self, block: Block) -> None:
        state, value, word = self._state, block.values["F"], block.texts["F"]
        if value < 0.0:
            raise GcodeError("a feed must be >= 0", word=word)
        if state.inverse_time:
            return
        state.feed = self._motion.metres(value, word) / 60.0
        state.feed_word = value
        units = block.g.get("units")
        if units is not None and (units[0] == 200) != state.inch:
            self._warn(
                f"{word} at line {self._flow.line}: read in "
                f"{'inch' if state.inch else 'mm'}/min, because LinuxCNC sets the feed before "
                f"the {units[1]} of the same line"
            )

    def _units(self, inch: bool) -> None:
        state = self._state
        if inch != state.inch:
            state.inch = inch
            state.feed_word *= 1e-3 / INCH if inch else INCH / 1e-3

    def _dwell(self, block: Block) -> None:
        word = block.g["non-modal"][1]
        if "P" not in block.values:
            raise GcodeError("a dwell needs its time, P in seconds", word=word)
        seconds = block.values["P"]
        if not 0.0 <= seconds <= 1e9:
            raise GcodeError("a dwell must be within 0 to 1e9 s", word=block.texts["P"])
        self._motion.recorder.dwell(seconds)

    def _path_control(self, block: Block) -> None:
        state, values = self._state, block.values
        if block.g["path control"][0] != 640:
            state.blend = state.merge = math.nan
            return
        for letter in "PQ":
            if values.get(letter, 0.0) < 0.0:
                raise GcodeError("a tolerance must be >= 0", word=block.texts[letter])
        tolerance = self._motion.metres(values.get("P", 0.0), block.texts.get("P", ""))
        merge = self._motion.metres(values["Q"], block.texts["Q"]) if "Q" in values else tolerance
        state.blend = tolerance if tolerance > 0.0 else math.inf
        state.merge = merge if merge > 0.0 else math.nan

    def _context(self, code: int) -> None:
        if code == 71:
            self._flow.forget()
        elif code == 72:
            try:
                self.restore(self._flow.saved_state())
            except GcodeError as error:
                raise GcodeError(error.message, word="M72") from None
        else:
            self._flow.save(self._state.save(self._offsets.system), restore=code == 73)

    # -- offsets --------------------------------------------------------------------------------

    def _check_machine_coordinates(self, block: Block, motion: int | None, text: str) -> None:
        distance = block.g.get("distance", (900 if self._state.absolute else 910, ""))[0]
        if motion not in (0, 10):
            raise GcodeError("machine coordinates need G0 or G1", word=text)
        if distance == 910:
            raise GcodeError("machine coordinates are absolute: not in G91", word=text)
        if "@" in block.values or "^" in block.values:
            raise GcodeError("polar coordinates cannot stand with it", word=text)

    def _placed(self) -> None:
        """Work out the position in the coordinate system that is now in force."""
        state, offsets = self._state, self._offsets
        state.position = state.machine if offsets.plain else offsets.to_program(state.machine)
        self._splines.interrupt()

    def _set_system(self, block: Block, word: str) -> None:
        values, texts = block.values, block.texts
        level = values.get("L", 0.0)
        if level in (0.0, 1.0, 10.0, 11.0):
            raise GcodeError("setting the tool table (G10 L1, L10, L11): not read", word=word)
        if level not in (2.0, 20.0):
            raise GcodeError("G10 needs L2 or L20", word=texts["L"])
        if "P" not in values:
            raise GcodeError("G10 needs P, the number of a coordinate system, 0 to 9", word=word)
        if "@" in values or "^" in values:
            raise GcodeError("polar coordinates are for motion only", word=word)
        if level == 20.0 and "R" in values:
            raise GcodeError("R cannot stand with G10 L20", word=texts["R"])
        try:
            self._offsets.set_system(
                int(level), values["P"], self._motion.lengths(block), values.get("R"),
                self._state.machine,
            )  # fmt: skip
        except GcodeError as error:
            raise GcodeError(error.message, word=error.word or texts["P"]) from None
        self._placed()

    def _shift(self, block: Block, code: int, word: str) -> None:
        words = self._motion.lengths(block) if code in (520, 920) else {}
        if code in (520, 920):
            if "@" in block.values or "^" in block.values:
                raise GcodeError("polar coordinates are for motion only", word=word)
            if not words:
                raise GcodeError("needs an axis word", word=word)
        self._offsets.shift_by(code, words, self._state.position)
        self._placed()
