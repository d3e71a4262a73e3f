"""Which columns of a log are the commanded and the actual positions: as stated, or guessed.

A guess rests on the words in a name: *set*, *cmd*, *soll* for commanded, *act*, *fb*, *ist* for
actual, and a letter for the axis, as in ``X_SetPosition`` or ``joint.0.pos-fb``. It is made only
where it leaves one reading, and always shown.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from contourlab.errors import ConfigurationError, LogError, choices
from contourlab.logs.source import Source
from contourlab.logs.written_units import split_title, unit_of

__all__ = ["Choice", "choose_columns", "find_column", "guess_command", "guess_time", "listed"]

ROLES = ("commanded", "actual", "command")
_WORDS = {
    "commanded": {
        "set", "setpoint", "setpos", "setposition", "cmd", "command", "commanded", "des", "desired",
        "ref", "reference", "nominal", "target", "demand", "soll", "sollwert", "lagesollwert", "sp",
        "consigne", "planned",
    },
    "actual": {
        "act", "actual", "actpos", "actposition", "fb", "feedback", "meas", "measured", "encoder",
        "enc", "ist", "istwert", "lageistwert", "real", "true",
    },
}  # fmt: skip
_OTHER = {
    "vel", "velocity", "speed", "v", "acc", "acceleration", "accel", "jerk", "current", "torque",
    "force", "power", "voltage", "error", "err", "ferror", "following", "deviation", "temp",
    "temperature", "load", "time", "feedrate", "status", "inertia",
}  # fmt: skip
_TIMES = (
    "time",
    "t",
    "timestamp",
    "zeit",
    "seconds",
    "sec",
    "elapsed",
    "datetime",
    "date",
    "temps",
)
_LETTERS = "XYZABCUVW"
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")


class Choice(NamedTuple):
    """Columns for a role, axis by axis."""

    names: tuple[str, ...]
    stated: bool
    """Whether the user or the format said so; else guessed."""


def listed(given: str | Sequence[str | int] | None, name: str) -> list[str] | None:
    """Return names as a list, from one text with commas or from a sequence.

    Parameters
    ----------
    given
        As the user wrote it.
    name
        Of the option.

    Raises
    ------
    ConfigurationError
        Not names.
    """
    if given is None:
        return None
    parts = given.split(",") if isinstance(given, str) else list(given)
    found = [str(part).strip() for part in parts]
    if not found or not all(found):
        raise ConfigurationError(f"{name} must name columns, with commas, got {given!r}")
    return found


def find_column(source: Source, wanted: str, what: str) -> str:
    """Return the column that a user means: its name in any case, without its unit, or its number.

    Parameters
    ----------
    source
        The log.
    wanted
        As written.
    what
        The option, for messages.

    Raises
    ------
    LogError
        There is none, or more than one; the columns are listed.
    """
    if wanted in source.names:
        return wanted
    folded = wanted.casefold()
    found = [one for one in source.names if one.casefold() == folded]
    found = found or [one for one in source.names if split_title(one)[0].casefold() == folded]
    if len(found) == 1:
        return found[0]
    if found:
        raise LogError(f"{source.name}: {what}: {wanted!r} may be {' or '.join(map(repr, found))}")
    if wanted.isdigit() and int(wanted) < len(source.names):
        return source.names[int(wanted)]
    shown = source.names if len(source.names) <= 80 else (*source.names[:80], "...")
    raise LogError(f"{source.name}: {what}: no column {wanted!r}; {choices(wanted, shown)}")


def choose_columns(
    source: Source,
    *,
    commanded: Sequence[str] | None,
    actual: Sequence[str] | None,
    command: Sequence[str] | None,
    axes: Sequence[str] | None,
) -> tuple[dict[str, Choice], tuple[str, ...]]:
    """Return the columns for each role, and the names of the axes.

    Parameters
    ----------
    source
        The log.
    commanded, actual, command
        Columns as stated; guessed if None (a command never is).
    axes
        Names of the axes, if stated.

    Raises
    ------
    LogError
        A column is not there, or none can be guessed.
    """
    stated = {"commanded": commanded, "actual": actual, "command": command}
    chosen: dict[str, Choice] = {}
    for role, names in stated.items():
        if names is not None:
            found = tuple(find_column(source, one, role) for one in names)
            if len(set(found)) != len(found):
                raise LogError(f"{source.name}: {role}: the same column twice: {', '.join(found)}")
            chosen[role] = Choice(found, True)
    if commanded is None and actual is None and source.roles:
        for role in ROLES:
            if role in source.roles and role not in chosen:
                chosen[role] = Choice(tuple(source.roles[role]), True)
        if "command" in chosen and len(chosen["command"].names) != len(source.axes):
            del chosen["command"]
        names = tuple(axes) if axes else source.axes
        return _same_width(source, chosen, names), names
    if "actual" not in chosen:
        chosen = {**_guessed(source, chosen.get("commanded"), axes), **chosen}
    elif "commanded" not in chosen:
        partner = _partner(source, "commanded", chosen["actual"].names)
        if partner is not None:
            chosen["commanded"] = Choice(partner, False)
    names = tuple(axes) if axes else _axis_names(chosen["actual"].names)
    return _same_width(source, chosen, names), names


def _same_width(
    source: Source, chosen: dict[str, Choice], axes: Sequence[str]
) -> dict[str, Choice]:
    for role, choice in chosen.items():
        if len(choice.names) != len(axes):
            raise LogError(
                f"{source.name}: {role} has {len(choice.names)} columns and the log {len(axes)} "
                f"axes ({', '.join(axes)}): give one column per axis, in the same order"
            )
    if len(set(axes)) != len(axes):
        raise LogError(f"{source.name}: the axes must have different names, got {', '.join(axes)}")
    both = [chosen[role].names for role in ("commanded", "actual") if role in chosen]
    if len(both) == 2 and set(both[0]) & set(both[1]):
        same = ", ".join(sorted(set(both[0]) & set(both[1])))
        raise LogError(f"{source.name}: {same}: commanded and actual cannot be the same column")
    return chosen


def _words(title: str) -> list[str]:
    return [word.casefold() for word in _WORD.findall(split_title(title)[0])]


def _axis_of(words: Sequence[str]) -> str | None:
    letters = [word.upper() for word in words if len(word) == 1 and word.upper() in _LETTERS]
    if letters:
        return letters[0]
    numbers = [word for word in words if word.isdigit()]
    if numbers:
        return numbers[0]
    glued = [w for w in words if len(w) > 2 and w[-1].upper() in "XYZ" and w[:-1] in _ALL_WORDS]
    return glued[0][-1].upper() if glued else None


_ALL_WORDS = {word for words in _WORDS.values() for word in words} | {"pos", "position"}


def _role_of(words: Sequence[str]) -> str | None:
    if set(words) & _OTHER:
        return None
    bare = {w[:-1] if w[-1:] in "xyz" and w[:-1] in _ALL_WORDS else w for w in words}
    roles = [role for role, known in _WORDS.items() if bare & known]
    return roles[0] if len(roles) == 1 else None


def _by_axis(source: Source, role: str) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for title in source.names:
        words = _words(title)
        axis = _axis_of(words)
        if axis is not None and _role_of(words) == role:
            found.setdefault(axis, []).append(title)
    return found


def _guessed(
    source: Source, commanded: Choice | None, axes: Sequence[str] | None
) -> dict[str, Choice]:
    if commanded is not None:
        partner = _partner(source, "actual", commanded.names)
        if partner is not None:
            return {"actual": Choice(partner, False)}
    tables = {role: _by_axis(source, role) for role in ("commanded", "actual")}
    both = [axis for axis in tables["actual"] if axis in tables["commanded"]]
    if axes is not None:
        both = [axis for axis in axes if axis in both]
    linear = [axis for axis in both if axis in "XYZUVW" or axis.isdigit()]
    clear = all(len(tables[role][axis]) == 1 for role in tables for axis in linear)
    if not linear or not clear or (axes is not None and len(both) != len(axes)):
        raise LogError(
            f"{source.name}: which columns are the positions cannot be guessed: name them with "
            f"commanded and actual; {choices('', source.names)}"
        )
    rotary = [axis for axis in both if axis in "ABC"
              and all(len(table[axis]) == 1 for table in tables.values())]  # fmt: skip
    return {role: Choice(tuple(table[axis][0] for axis in [*linear, *rotary]), False)
            for role, table in tables.items()}  # fmt: skip


def _partner(source: Source, role: str, names: Sequence[str]) -> tuple[str, ...] | None:
    """Return the columns of a role on the axes of columns of the other one, if that is clear."""
    table = _by_axis(source, role)
    found = []
    for name in names:
        axis = _axis_of(_words(name))
        if axis is None or len(table.get(axis, [])) != 1 or table[axis][0] in names:
            return None
        found.append(table[axis][0])
    return tuple(found)


def _axis_names(columns: Sequence[str]) -> tuple[str, ...]:
    letters = [_axis_of(_words(name)) for name in columns]
    known = [one for one in letters if one is not None]
    if len(set(known)) == len(columns) and not all(one.isdigit() for one in known):
        return tuple(known)
    if len(columns) <= 3:
        return tuple("XYZ"[: len(columns)])
    return tuple(f"axis{k}" for k in range(len(columns)))


def guess_command(source: Source, axes: Sequence[str]) -> tuple[str, ...] | None:
    """Return the columns that hold what the drives were told, None if that is not clear.

    Columns of force or voltage, by their word and by their unit, one for each axis. What was
    measured is none.

    Parameters
    ----------
    source
        The log.
    axes
        Names of its axes, in order.
    """
    for word, unit in (("force", "N"), ("voltage", "V")):
        table: dict[str, list[str]] = {}
        for title in source.names:
            words = _words(title)
            axis = _axis_of(words)
            written = unit_of(title, source.units.get(title, ""))
            told = word in words and written == unit and not set(words) & _WORDS["actual"]
            if axis is not None and told:
                table.setdefault(axis, []).append(title)
        if all(len(table.get(axis, [])) == 1 for axis in axes):
            return tuple(table[axis][0] for axis in axes)
    return None


def guess_time(source: Source) -> str | None:
    """Return the column that is called time, None if there is none or more than one.

    Parameters
    ----------
    source
        The log.
    """
    if source.time is not None:
        return source.time
    plain = {
        title: re.sub(r"[^a-z]", "", split_title(title)[0].casefold()) for title in source.names
    }
    for word in _TIMES:
        found = [title for title, name in plain.items() if name == word]
        if len(found) == 1:
            return found[0]
    found = [title for title, name in plain.items() if name.endswith(("time", "timestamp", "zeit"))
             and not name.endswith("runtime")]  # fmt: skip
    return found[0] if len(found) == 1 else None
