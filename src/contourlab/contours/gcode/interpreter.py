"""The interpreter: lines in the order in which they run, one modal state, moves out.

What LinuxCNC does with the same program is the reference. Lengths become metres as they are read.
The machine stands at the given start before the first move, and every work offset is zero; moves
are in machine coordinates.

Differences from LinuxCNC
-------------------------
Before the first G61 or G64 pieces are exact stops (LinuxCNC starts in G64 without tolerance).
G64 P0 is G64 without a tolerance, as in LinuxCNC; a negative P or Q is refused (LinuxCNC takes it
as absent). P words that a dwell or G64 and an arc in one line would share are refused, as are an R
below 0.00005 inch, more than 10 000 turns, splines as told in ``spline_motion`` and two signs
before the number of a word. A program may end without M2, M30 or %, and comments may stand before
its first %. Lines may have 4096 characters, not 255. Lines that are skipped are not looked at, not
even at their comments. M99 in the program itself, which repeats it for ever, is refused. Parameters
whose value only the machine knows are refused when they are read.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from contourlab.contours.gcode.blocks import Block
from contourlab.contours.gcode.control import Flow
from contourlab.contours.gcode.executor import Executor
from contourlab.contours.gcode.lexer import strip_comments
from contourlab.contours.gcode.modal import ModalState
from contourlab.contours.gcode.motion import LARGEST, MOST_TURNS, SHORTEST, Motion
from contourlab.contours.gcode.offsets import Offsets
from contourlab.contours.gcode.parameters import Parameters
from contourlab.contours.gcode.predefined import UNKNOWN, computed_numbers, predefined_names
from contourlab.contours.gcode.recorder import MoveRecorder, Place
from contourlab.contours.gcode.sources import Source, Sources
from contourlab.contours.gcode.statements import END, Control, Statement, read_statement
from contourlab.contours.part import Ignored, Moves, SourceFile, axis_columns
from contourlab.errors import ConfigurationError, GcodeError, choices

__all__ = ["LARGEST", "MOST_TURNS", "SHORTEST", "Interpretation", "Interpreter"]

_MOST_WARNINGS = 100


@dataclass(frozen=True, kw_only=True)
class Interpretation:
    """What a program does."""

    moves: Moves
    ignored: dict[str, Ignored]
    warnings: tuple[str, ...]
    largest_center_move: float
    files: tuple[SourceFile, ...]
    """The program and the files of its subprograms."""


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
        ``"mm"`` or ``"inch"``: units before the first G20 or G21, and of the parameters of
        coordinate systems. In LinuxCNC the machine decides.
    block_delete
        Whether lines that start with ``/`` are skipped.
    start
        Where the machine stands before the first move [m].
    most_pieces
        More pieces than this are refused.
    folder
        Where files of subprograms may stand; without it a program cannot call another file.
    """

    name: str = "program"
    axes: Sequence[str] = ("X", "Y", "Z")
    default_units: str = "mm"
    block_delete: bool = False
    start: Sequence[float | int] = (0.0, 0.0, 0.0)
    most_pieces: int = 5_000_000
    folder: Path | None = None
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
        inch = self.default_units == "inch"
        self.state = ModalState(position=(x, y, z), machine=(x, y, z), inch=inch)
        self._recorder = MoveRecorder()
        self._offsets = Offsets(inch=inch)
        self._motion = Motion(
            self.state, self._offsets, self._recorder, self.axes,
            tuple(k for k in range(3) if k not in columns), self.most_pieces,
        )  # fmt: skip
        self._ignored: dict[str, list[int]] = {}
        self._warnings: list[str] = []
        self._delimited: bool | None = None

    def run(self, lines: Iterable[str]) -> Interpretation:
        """Read the lines of a program to its end.

        Parameters
        ----------
        lines
            Text, without line ends.

        Raises
        ------
        GcodeError
            With name, line and word: anything that is not read.
        """
        main = Source(self.name, lines if isinstance(lines, list) else list(lines))
        sources = Sources(main, self.folder, sum(map(len, main.lines)) if self.folder else 0)
        names: dict[str, object] = {}
        parameters = Parameters(computed_numbers(self.state), names, UNKNOWN)  # type: ignore[arg-type]
        self._offsets.parameters = parameters
        self._flow = flow = Flow(sources=sources, parameters=parameters)
        names.update(predefined_names(self.state, self._offsets, flow))
        executor = Executor(self._motion, flow, self._ignore, self._warn)
        try:
            self._run(flow, parameters, executor)
            flow.check_end()
            executor.check_end()
        except GcodeError as error:
            raise GcodeError(
                error.message,
                file=error.file or flow.source.name,
                line=error.line or flow.line,
                word=error.word,
            ) from None
        self._final_warnings(flow, parameters)
        return Interpretation(
            moves=self._recorder.moves(),
            ignored={name: Ignored(*seen) for name, seen in self._ignored.items()},
            warnings=tuple(self._warnings),
            largest_center_move=self._motion.center_move,
            files=tuple(SourceFile(source.name, source.lines) for source in sources.all),
        )

    def _run(self, flow: Flow, parameters: Parameters, executor: Executor) -> None:
        motion = self._motion
        while True:
            source, at = flow.source, flow.at
            if flow.skipping is not None:
                at = source.next_control(at)
            if at >= len(source.lines):
                return
            flow.at = at + 1
            flow.line = line = at + 1
            flow.run += 1
            if not source.has_control:
                statement = self._read(flow, source.lines[at])
            elif at in source.statements:
                statement = source.statements[at]
            else:
                statement = self._read(flow, source.lines[at])
                if flow.skipping is None:
                    source.statements[at] = statement
            if statement is None:
                continue
            if statement is END:
                return
            if isinstance(statement, Control):
                self._control(flow, parameters, executor, statement)
                continue
            if flow.skipping is not None:
                continue
            flow.done += 1
            block = statement if isinstance(statement, Block) else statement.block(parameters)
            if block is None:
                continue
            main = source.number == 0
            motion.place = Place(line if main else flow.call_line, source.number, line)
            executor.execute(block)
            if block.stop:
                flow.skipping, flow.frames = None, []
                return

    def _read(self, flow: Flow, text: str) -> Statement | None:
        """Return what a line says: None for nothing, END for the last %."""
        code = strip_comments(text)
        if not code:
            return None
        if code == "%":
            return self._percent(flow)
        if self._delimited is None and flow.source.number == 0:
            self._delimited = False
        if code[0] == "/":
            code = code[1:]
            if self.block_delete or not code:
                return None
        statement = read_statement(code)
        if isinstance(statement, Control) and text.lstrip(" \t/")[:1] == "(":
            raise GcodeError("a comment stands before the o-word", word=statement.text)
        return statement

    def _percent(self, flow: Flow) -> Statement | None:
        """Return what a line with % alone means: the beginning, the end, or a mistake."""
        if flow.source.number == 0:
            if self._delimited:
                return END
            if self._delimited is None:
                self._delimited = True
                return None
        elif not self._delimited and flow.skipping is not None:
            return None
        raise GcodeError(
            "may stand only alone on the first line of the program and on its last", word="%"
        )

    def _control(
        self, flow: Flow, parameters: Parameters, executor: Executor, word: Control
    ) -> None:
        try:
            flow.control(word)
        except GcodeError as error:
            raise GcodeError(
                error.message, file=error.file, line=error.line, word=error.word or word.text
            ) from None
        saved = flow.take_restored()
        if saved is not None:
            executor.restore(saved)

    def _final_warnings(self, flow: Flow, parameters: Parameters) -> None:
        for name in sorted(parameters.surprises):
            self._warn(
                f"#<{name}> was read as 0 in the line that sets it first: LinuxCNC does the same"
            )
        if flow.surprised_line:
            self._warn(
                f"the do loop that ends at line {flow.surprised_line} was left although its "
                "condition held: LinuxCNC leaves it after a break out of a while loop before it"
            )

    def _ignore(self, name: str) -> None:
        seen = self._ignored.setdefault(name, [self._flow.line, 0])
        seen[1] += 1

    def _warn(self, text: str) -> None:
        if len(self._warnings) < _MOST_WARNINGS and text not in self._warnings:
            self._warnings.append(text)
