"""Every error that contourlab raises on purpose.

All of them come from :class:`ContourlabError` and speak of something the user can change: the
command line prints the message and exits with status 2. An exception that is *not* in this tree is
a defect of contourlab (exit status 1).
"""

from __future__ import annotations

from collections.abc import Iterable

__all__ = [
    "ConfigurationError",
    "ContourlabError",
    "ExportError",
    "FeedError",
    "GcodeError",
    "GeometryError",
    "LogError",
    "OutputError",
    "PartError",
    "RecordingError",
    "RefusedError",
    "ScenarioError",
    "SimulationError",
    "TravelError",
    "UnitError",
    "choices",
]


class ContourlabError(Exception):
    """Root of the tree."""


class ConfigurationError(ContourlabError, ValueError):
    """A value of a configuration is outside its bounds; names the value, the bound, the unit."""


class UnitError(ConfigurationError):
    """A quantity has no unit, an unknown one, or one of another kind."""


class GeometryError(ContourlabError, ValueError):
    """A curve cannot be made or asked this: zero length, a parameter outside the domain, NaN."""


class PartError(ContourlabError):
    """A part file cannot be read or does not describe a path."""


class GcodeError(PartError):
    """A G-code program is refused; says file, line and word.

    Parameters
    ----------
    message
        What was wrong and what is allowed.
    file, line, word
        Where: name of the program, line counted from 1, the offending word as written.
    """

    def __init__(self, message: str, *, file: str = "", line: int = 0, word: str = "") -> None:
        self.message, self.file, self.line, self.word = message, file, line, word
        place = f"{file or 'program'}:{line}: " if line else (f"{file}: " if file else "")
        super().__init__(f"{place}{f'{word}: ' if word else ''}{message}")


class FeedError(ContourlabError, ValueError):
    """A motion cannot be planned: no feed, zero limits, a negative rate."""


class TravelError(ContourlabError):
    """The part leaves the travel of the machine."""


class RefusedError(ContourlabError):
    """Two parts do not go together: a law and a contour, a law and a machine."""


class SimulationError(ContourlabError, ValueError):
    """A closed loop cannot be run as asked."""


class RecordingError(ContourlabError):
    """A recording cannot be read, or lacks what is asked of it."""


class LogError(ContourlabError):
    """A measured log cannot be read or judged; says file, line or column, and what is allowed."""


class ScenarioError(ContourlabError):
    """A scenario file is wrong; says file, line, key, value and the allowed choices.

    Parameters
    ----------
    message
        What was wrong and what is allowed.
    file, line, key
        Where: the scenario, the line counted from 1 (0 if unknown), the dotted key.
    """

    def __init__(self, message: str, *, file: str = "", line: int = 0, key: str = "") -> None:
        self.message, self.file, self.line, self.key = message, file, line, key
        place = ":".join(str(part) for part in (file, line) if part)
        super().__init__(": ".join(part for part in (place, key, message) if part))


class ExportError(ContourlabError):
    """A law cannot be exported; names the operation and the line of the law that uses it."""


class OutputError(ContourlabError):
    """A file cannot be written: it exists already, or its folder cannot be used."""


def choices(given: object, allowed: Iterable[str]) -> str:
    """Return a half sentence that names the allowed values, the likely one first.

    Parameters
    ----------
    given
        What was written.
    allowed
        What may be written.

    Examples
    --------
    >>> choices("elipse", ["circle", "ellipse"])
    'did you mean ellipse? Allowed: circle, ellipse'
    """
    from difflib import get_close_matches

    names = sorted(allowed)
    close = get_close_matches(str(given), names, n=1)
    hint = f"did you mean {close[0]}? " if close else ""
    return f"{hint}Allowed: {', '.join(names) if names else 'none'}"
