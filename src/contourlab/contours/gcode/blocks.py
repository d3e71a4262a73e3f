"""From words to a block: what one line says, by modal groups.

The groups are LinuxCNC's. Two words of one group in a line contradict each other and are refused,
as is any other letter given twice. Every G and M word stands in one of three tables: those that are
read, those that do not move the tool, and those that are refused by name; a number in none of them
is unknown.
"""

from __future__ import annotations

from collections.abc import Sequence

from contourlab.contours.gcode.lexer import Word
from contourlab.contours.gcode.parameters import EQUAL
from contourlab.errors import GcodeError

__all__ = ["Block"]

_READ_G: dict[int, str] = {
    **dict.fromkeys((0, 10, 20, 30, 50, 51, 52, 800), "motion"),
    **dict.fromkeys((40, 53, 100, 520, 530, 920), "non-modal"),
    **dict.fromkeys((921, 922, 923), "offset in force"),
    **dict.fromkeys((170, 180, 190), "plane"),
    **dict.fromkeys((200, 210), "units"),
    400: "cutter compensation",
    **dict.fromkeys((430, 490), "tool length"),
    **dict.fromkeys((540, 550, 560, 570, 580, 590, 591, 592, 593), "coordinate system"),
    **dict.fromkeys((610, 611, 640), "path control"),
    80: "lathe diameter",
    **dict.fromkeys((900, 910), "distance"),
    **dict.fromkeys((901, 911), "arc distance"),
    **dict.fromkeys((930, 940), "feed mode"),
    **dict.fromkeys((960, 970), "spindle mode"),
    **dict.fromkeys((980, 990), "retract"),
}
"""Modal group by ten times the number of a G word."""

_STILL_G = frozenset((960, 970, 980, 990))
"""G words that are read but move nothing here: listed as ignored."""

_REFUSED_G: dict[int, str] = {
    **dict.fromkeys((60, 61, 62, 63), "splines of another controller (G6)"),
    70: "diameter mode (G7)",
    **dict.fromkeys((171, 181, 191), "the planes UV, WU, VW (G17.1 to G19.1)"),
    **dict.fromkeys((280, 281, 300, 301), "returning to stored positions (G28, G30)"),
    **dict.fromkeys((330, 331), "spindle-synchronised motion (G33)"),
    **dict.fromkeys((382, 383, 384, 385), "probing (G38)"),
    **dict.fromkeys((410, 411, 420, 421), "cutter compensation (G41, G42)"),
    **dict.fromkeys((431, 432), "tool length offsets of their own (G43.1, G43.2)"),
    **dict.fromkeys((500, 510), "scaling (G50, G51)"),
    **dict.fromkeys((700, 710, 711, 712, 720, 721, 722), "lathe cycles (G70 to G72)"),
    **dict.fromkeys(
        (730, 740, 760, 810, 820, 830, 840, 850, 860, 870, 880, 890),
        "canned cycles (G73 to G89)",
    ),
    950: "feed per revolution (G95), which depends on the spindle,",
}

_M_GROUP: dict[int, int] = {
    **dict.fromkeys((0, 1, 2, 30, 60), 4),
    **dict.fromkeys((62, 63, 64, 65, 66, 67, 68), 5),
    **dict.fromkeys((6, 61), 6),
    **dict.fromkeys((3, 4, 5, 19, 70, 71, 72, 73), 7),
    **dict.fromkeys((7, 8, 9), 8),
    **dict.fromkeys((48, 49, 50, 51, 52, 53), 9),
}
"""Modal group of the M words that are read; only M2, M30 and M70 to M73 do anything here."""

_M_WORDS: dict[int, str] = {
    19: "RQP", 50: "P", 51: "P", 52: "P", 53: "P", 61: "Q", 62: "P", 63: "P", 64: "P", 65: "P",
    66: "PELQ", 67: "EQ", 68: "EQ",
}  # fmt: skip
"""Letters that belong to an M word."""

_REFUSED_M: dict[int, str] = {
    **dict.fromkeys((98, 99), "subprogram calls (M98, M99) that do not begin their line"),
    **dict.fromkeys(range(100, 200), "user-defined M words (M100 to M199)"),
}

_REFUSED_LETTERS = dict.fromkeys("ABC", "rotary axes (A, B, C)") | dict.fromkeys(
    "UVW", "secondary axes (U, V, W)"
)

_LETTERS = frozenset("DEFHIJKLPQRSTXYZ@^$")
_NOT_NEGATIVE = frozenset("STDH")


class Block:
    """What one line says.

    Parameters
    ----------
    words
        The words of the line.

    Raises
    ------
    GcodeError
        Two words of one modal group, a letter twice, a word that is unknown or refused.
    """

    __slots__ = ("context", "g", "ignored", "m_letters", "stop", "texts", "values")

    def __init__(self, words: Sequence[Word]) -> None:
        self.g: dict[str, tuple[int, str]] = {}
        """Ten times the number of the G word, and its text, by modal group."""
        self.values: dict[str, float] = {}
        """Values by letter, in the units of the program."""
        self.texts: dict[str, str] = {}
        """Words as written, by letter."""
        self.ignored: list[str] = []
        """Names of words that do not move the tool."""
        self.m_letters = ""
        """Letters that belong to M words of the line."""
        self.stop = False
        """Whether the program ends here (M2, M30)."""
        self.context = 0
        """70 to 73 for the M word that saves or restores the modal state, else 0."""
        groups: dict[int, str] = {}
        values, texts = self.values, self.texts
        for position, (letter, value, text) in enumerate(words):
            if letter == "G":
                self._add_g(value, text)
            elif letter in _LETTERS:
                if letter in values:
                    raise GcodeError(f"the line has {texts[letter]} already", word=text)
                if value < 0.0 and letter in _NOT_NEGATIVE:
                    raise GcodeError("the number must be >= 0", word=text)
                values[letter] = value
                texts[letter] = text
            elif letter == "M":
                self._add_m(value, text, groups)
            elif letter == "N":
                if position:
                    raise GcodeError("a line number may stand only at the start", word=text)
                if value < 0:
                    raise GcodeError("a line number must be >= 0", word=text)
                self.ignored.append("N")
            elif letter in _REFUSED_LETTERS:
                raise GcodeError(f"{_REFUSED_LETTERS[letter]}: not read", word=text)
            else:
                raise GcodeError("the letter is not known", word=text)

    def filled(self, words: Sequence[Word]) -> Block:
        """Return the same block with other values.

        Parameters
        ----------
        words
            The words of the line, of which G, M and N are as they were.

        Raises
        ------
        GcodeError
            A value that may not be negative.
        """
        block = Block.__new__(Block)
        block.g, block.texts, block.ignored = self.g, self.texts, self.ignored
        block.m_letters, block.stop, block.context = self.m_letters, self.stop, self.context
        block.values = values = {}
        for letter, value, text in words:
            if letter in _LETTERS:
                if value < 0.0 and letter in _NOT_NEGATIVE:
                    raise GcodeError("the number must be >= 0", word=text)
                values[letter] = value
        return block

    def _add_g(self, value: float, text: str) -> None:
        tenths = round(10.0 * value) if abs(value) < 1000.0 else -1
        group = _READ_G.get(tenths) if abs(10.0 * value - tenths) < 1e-6 else None
        if group is None:
            what = _REFUSED_G.get(tenths) if abs(10.0 * value - tenths) < 1e-6 else None
            raise GcodeError(
                f"{what}: not read" if what else "the G word is not known",
                word=text,
            )
        if group in self.g:
            tenths_before, text_before = self.g[group]
            if group != "motion" or 800 not in (tenths, tenths_before) or tenths == tenths_before:
                raise GcodeError(
                    f"the line has {text_before} already, of the same modal group ({group})",
                    word=text,
                )
            if tenths == 800:
                return  # LinuxCNC lets the other motion word win over G80
        self.g[group] = (tenths, text)
        if tenths == 430:
            self.m_letters += "H"
        if tenths in _STILL_G:
            self.ignored.append(f"G{tenths // 10}")
            if tenths == 960:
                self.m_letters += "D"

    def _add_m(self, value: float, text: str, groups: dict[int, str]) -> None:
        number = round(value) if abs(value) < 1000.0 else -1
        if abs(number - value) > EQUAL:
            number = -1
        group = _M_GROUP.get(number)
        if group is None:
            what = _REFUSED_M.get(number)
            raise GcodeError(
                f"{what}: not read" if what else "the M word is not known",
                word=text,
            )
        if group in groups:
            raise GcodeError(
                f"the line has {groups[group]} already, of the same modal group", word=text
            )
        groups[group] = text
        self.m_letters += _M_WORDS.get(number, "")
        if number in (2, 30):
            self.stop = True
        elif group == 7 and number >= 70:
            self.context = number
        else:
            self.ignored.append(f"M{number}")
