"""O-words: which line comes next.

The machine below is LinuxCNC's: one that reads line after line and, where a branch is not taken, a
loop is left or a subprogram is looked for, skips to the line of a label. Lines that are skipped are
not read. A label inside a subprogram is that subprogram's own; labels of subprograms are the
program's. A subprogram is found where it was defined, else in a file of its name, else further
down.

Two habits of LinuxCNC are kept because they decide where the tool goes: ``return`` leaves the
subprogram that is running whatever its label, and a ``break`` out of a ``while`` loop, taken or
skipped over, makes the next ``do`` loop run once only (the reader warns).

A loop that comes round with nothing done since it last began never ends: it is refused at once. Any
other endless loop is refused after :data:`MOST_REPEATED` lines.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from contourlab.contours.gcode.frames import Frame, Label, Saved
from contourlab.contours.gcode.modal import SavedState
from contourlab.contours.gcode.parameters import ARGUMENTS, Parameters
from contourlab.contours.gcode.sources import Source, Sources
from contourlab.contours.gcode.statements import Control
from contourlab.errors import GcodeError

__all__ = ["DEEPEST_CALL", "MOST_REPEATED", "Flow"]

DEEPEST_CALL = 9
"""Calls inside calls."""

MOST_REPEATED = 3_000_000
"""Lines that may be run beyond those that the program has."""

_GLOBAL = frozenset(("sub", "program", "endsub", "call", "return", "m98", "m99"))


@dataclass(kw_only=True)
class Flow:
    """The place in the program, and everything that decides where it goes on.

    Parameters
    ----------
    sources
        The files of the program.
    parameters
        Its parameters.
    """

    sources: Sources
    parameters: Parameters
    source: Source = field(init=False)
    at: int = 0
    """Next line, counted from 0."""
    line: int = 0
    """Line that is read, counted from 1."""
    skipping: str | None = None
    """Label that is looked for; lines are skipped until then."""
    frames: list[Frame] = field(default_factory=list)
    saved: dict[int, Saved] = field(default_factory=dict)
    """Modal states saved by M70 and M73, by depth of call."""
    value: float = 0.0
    """What the last subprogram returned."""
    value_returned: bool = False
    done: int = 0
    """Counts whatever may change something."""
    run: int = 0
    """Lines run so far."""
    call_line: int = 0
    """Line of the program from which a subprogram in another file was called."""
    surprised_line: int = 0
    """Line of the first do loop that ended early because of a break before it."""

    def __post_init__(self) -> None:
        self.source = self.sources.all[0]
        self._most = len(self.source.lines) + MOST_REPEATED
        self._labels: dict[str, Label] = {}
        self._defining: str | None = None
        self._seeking = False
        self._skip_from: tuple[Source, int, str] | None = None
        self._executed_if = True
        self._breaking = self._continuing = False
        self._returned: list[Saved] = []

    # -- the end ------------------------------------------------------------------------------

    def check_end(self) -> None:
        """Refuse a file that ends while something is open.

        Raises
        ------
        GcodeError
            A label that was looked for is missing, or a subprogram has no end.
        """
        if self.skipping is not None and self._skip_from is not None:
            source, line, text = self._skip_from
            name = self.skipping.partition("#")[2] or self.skipping
            what = (
                f"there is no subprogram o<{name}>, in the program or as {name}.ngc in its folder"
                if self._seeking
                else f"the end of o<{name}> is missing"
            )
            raise GcodeError(what, file=source.name, line=line, word=text)
        if self.frames:
            raise GcodeError(
                f"the subprogram o<{self.frames[-1].name}> has no end",
                file=self.source.name, line=len(self.source.lines),
            )  # fmt: skip

    def save(self, state: SavedState, *, restore: bool) -> None:
        """Keep a modal state for the call that is running (M70, M73).

        Parameters
        ----------
        state
            What to keep.
        restore
            Whether it is to be restored when the call ends.
        """
        self.saved[len(self.frames)] = Saved(state, restore=restore and bool(self.frames))

    def forget(self) -> None:
        """Take back what was saved (M71)."""
        if len(self.frames) in self.saved:
            self.saved[len(self.frames)].valid = False

    def saved_state(self) -> SavedState:
        """Return what was saved in the call that is running (M72).

        Raises
        ------
        GcodeError
            Nothing was.
        """
        saved = self.saved.get(len(self.frames))
        if saved is None or not saved.valid:
            raise GcodeError("nothing was saved by M70 or M73 in this call")
        return saved.state

    def take_restored(self) -> SavedState | None:
        """Return the modal state that a subprogram that has just ended gives back (M73)."""
        return self._returned.pop().state if self._returned else None

    # -- one o-word ---------------------------------------------------------------------------

    def control(self, word: Control) -> None:
        """Execute an o-word, M98 or M99.

        Parameters
        ----------
        word
            What the line says.

        Raises
        ------
        GcodeError
            Whatever does not fit together.
        """
        kind = word.kind
        if kind == "m98" and self.skipping is not None:
            return
        times = 1
        if kind == "m98":
            key, times = word.subprogram(self.parameters)
        elif kind == "m99":
            key = self.frames[-1].name if self.frames else ""
        elif kind in _GLOBAL:
            key = word.label(self.parameters)
        else:
            scope = self.frames[-1].name if self.frames else self._defining or ""
            key = f"{scope}#{word.label(self.parameters)}"
        skipping = self.skipping
        if kind in ("sub", "program"):
            self._check_not_nested(key)
        elif self._defining is not None and kind not in ("endsub", "return", "m99"):
            return
        if skipping is not None and skipping != key:
            return
        values: list[float] = []
        ends = kind in ("endsub", "return")
        if kind not in ("m98", "m99", "call") and (self.frames or not ends):
            values = word.values(self.parameters)
        if ends:
            self.value, self.value_returned = (values[0], True) if values else (0.0, False)
        if self._seeking and kind not in ("sub", "program"):
            return
        if kind in ("call", "m98"):
            if skipping is None:
                self._call(kind, key, word, times)
        elif kind in ("sub", "program"):
            self._sub(kind, key, word)
        elif kind in ("endsub", "return", "m99"):
            self._return(kind, key)
        elif kind in ("if", "elseif", "else", "endif"):
            self._branch(kind, key, values[0] if values else 0.0, word)
        else:
            self._loop(kind, key, values[0] if values else 0.0, word)

    def _check_not_nested(self, key: str) -> None:
        inside = self.frames and self.skipping is None and key != self.frames[-1].name
        if self._defining is not None or inside:
            raise GcodeError("a subprogram may not be defined inside another one")

    # -- subprograms --------------------------------------------------------------------------

    def _sub(self, kind: str, key: str, word: Control) -> None:
        called_as = self.frames[-1].kind if self.frames else ""
        if kind == "program" and called_as == "call":
            raise GcodeError("a program O... is called by M98, not by an o-word call")
        if kind == "sub" and called_as == "m98":
            raise GcodeError("a subprogram o... sub is called by an o-word call, not by M98")
        if self.skipping is not None:
            self._remember(kind, key)
            self.skipping = None
        self._seeking = False
        if kind == "program":
            if self.frames:
                self.frames[-1].begin = self.source, self.line - 1
            return
        if not self.frames:
            self._remember(kind, key)
            self._skip(key, word)
            self._defining = key

    def _remember(self, kind: str, key: str) -> None:
        known = self._labels.get(key)
        if known is not None:
            raise GcodeError(
                f"o<{key}> is defined in line {known.line + 1} of {known.source.name} already, or "
                "the program runs into a subprogram that it has called before"
            )
        self._labels[key] = Label(kind, self.source, self.line - 1)

    def _call(self, kind: str, key: str, word: Control, times: int) -> None:
        parameters = self.parameters
        values = word.values(parameters) if kind == "call" else []
        if times == 0:
            return
        if len(self.frames) >= DEEPEST_CALL:
            raise GcodeError(f"subprograms may call one another {DEEPEST_CALL} deep")
        self._count()
        self.done += 1
        if self.source.number == 0:
            self.call_line = self.line
        known = self._labels.get(key)
        source = None if known is not None else self.sources.find(key)
        numbers = parameters.numbers
        self.frames.append(Frame(
            key, kind, self.source, self.at, None, times,
            tuple(numbers.get(number, 0.0) for number in range(1, ARGUMENTS + 1)), parameters.call,
        ))  # fmt: skip
        parameters.call = {}
        if kind == "call":
            for number in range(1, ARGUMENTS + 1):
                numbers[number] = values[number - 1] if number <= len(values) else 0.0
        if known is not None:
            self.source, self.at = known.source, known.line
            self.frames[-1].begin = known.source, known.line
            return
        self._skip(key, word)
        self._seeking = True
        if source is not None:
            self.source, self.at = source, 0

    def _return(self, kind: str, key: str) -> None:
        if not self.frames:
            if kind == "m99":
                raise GcodeError("M99 in the program itself repeats it for ever")
            if self._defining is None:
                raise GcodeError("stands in no subprogram")
            if kind == "endsub":
                self.skipping = self._defining = None
            return
        frame = self.frames[-1]
        if frame.kind == "m98" and kind != "m99":
            raise GcodeError("a subprogram that M98 calls ends with M99")
        if frame.kind == "call" and kind == "m99":
            raise GcodeError("a subprogram o... sub ends with endsub or return, not with M99")
        if kind == "endsub" and key != frame.name:
            raise GcodeError(f"o<{key}> endsub, but the subprogram that runs is o<{frame.name}>")
        self.skipping = None
        self.done += 1
        saved = self.saved.pop(len(self.frames), None)
        if saved is not None and saved.valid and saved.restore:
            self._returned.append(saved)
        frame.times -= 1
        if frame.times > 0 and frame.begin is not None:
            self._count()
            self.source, self.at = frame.begin
            self.parameters.call = {}
            return
        self.frames.pop()
        if frame.kind == "call":
            for number, value in enumerate(frame.numbers, start=1):
                self.parameters.numbers[number] = value
        self.parameters.call = frame.call
        self.source, self.at = frame.source, frame.line

    # -- branches and loops -------------------------------------------------------------------

    def _branch(self, kind: str, key: str, test: float, word: Control) -> None:
        if kind == "if":
            self._first_time(kind, key)
            self._executed_if = test != 0.0
            self.skipping = None
            if not self._executed_if:
                self._skip(key, word)
            return
        self._partner(kind, key, ("if",))
        if kind == "endif":
            self.skipping = None
            self._executed_if = True
        elif self._executed_if:
            self._skip(key, word)
        elif kind == "else" or test != 0.0:
            self.skipping = None
            self._executed_if = True

    def _loop(self, kind: str, key: str, test: float, word: Control) -> None:
        known = self._labels.get(key)
        if kind == "do":
            self.skipping = None
            if known is None:
                self._remember(kind, key)
            self._labels[key].done = self.done
        elif kind == "while" and known is not None and known.kind == "do":
            self.skipping = None
            if test != 0.0 and not self._breaking:
                self._back(known)
            elif test != 0.0 and known.repeats != -2:
                self.surprised_line = self.surprised_line or self.line
            known.repeats = -1
            self._breaking = False
        elif kind in ("while", "repeat"):
            label = self._first_time(kind, key)
            self.skipping = None
            if kind == "while":
                goes_on = test != 0.0
            else:
                if label.repeats == -1:
                    label.repeats = max(int(test + 0.5), 0)  # as LinuxCNC rounds it
                goes_on = label.repeats > 0
                label.repeats = label.repeats - 1 if goes_on else -1
            label.done = self.done
            if not goes_on:
                self._skip(key, word)
        elif kind in ("break", "continue"):
            label = self._partner(kind, key, ("while", "do"))
            if kind == "break":
                self._breaking = True
                if label.kind == "do":
                    label.repeats = -2
            elif self.skipping is None:
                self._continuing = True
            self._skip(key, word)
        else:
            label = self._partner(kind, key, (kind.removeprefix("end"),))
            if self.skipping is None or self._continuing:
                if self.skipping is not None:
                    self._continuing = False
                self.skipping = None
                self._back(label)
            self.skipping = None

    def _back(self, label: Label) -> None:
        if label.done == self.done and label.kind != "repeat":
            raise GcodeError("the loop never ends: nothing in it changes anything")
        self._count()
        self.source, self.at = label.source, label.line

    def _first_time(self, kind: str, key: str) -> Label:
        known = self._labels.get(key)
        if known is None:
            self._remember(kind, key)
            return self._labels[key]
        if known.line != self.line - 1 or known.source is not self.source or known.kind != kind:
            name = key.partition("#")[2]
            raise GcodeError(f"the label o<{name}> is in use already, in line {known.line + 1}")
        return known

    def _partner(self, kind: str, key: str, kinds: tuple[str, ...]) -> Label:
        known = self._labels.get(key)
        if known is None or known.kind not in kinds:
            name = key.partition("#")[2]
            raise GcodeError(f"{kind} without o<{name}> {' or '.join(kinds)} before it")
        return known

    def _skip(self, key: str, word: Control) -> None:
        self.skipping = key
        self._skip_from = self.source, self.line, word.text

    def _count(self) -> None:
        if self.run > self._most:
            raise GcodeError(
                f"the program has run {self.run} lines and goes on: an endless loop, or more than "
                "this reader's bound"
            )
