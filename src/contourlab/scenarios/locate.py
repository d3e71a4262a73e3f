"""Where in a TOML file a key stands, for messages that name the line."""

from __future__ import annotations

import re

__all__ = ["line_of"]

_TABLE = re.compile(r"^\s*(\[\[?)\s*([^\[\]#]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"^\s*((?:[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')(?:\s*\.\s*[A-Za-z0-9_-]+)*)\s*=")

Key = tuple[str | int, ...]


def line_of(text: str, key: Key) -> int:
    """Return the line of a key in a TOML text, or of the nearest table that should hold it.

    Parameters
    ----------
    text
        The file's text.
    key
        Names, and positions in arrays of tables, such as ``("controller", 1, "kp")``.

    Returns
    -------
    int
        Counted from 1; 0 if nothing of the key stands in the text.
    """
    lines = _index(text)
    for length in range(len(key), 0, -1):
        if key[:length] in lines:
            return lines[key[:length]]
    return 0


def _parts(dotted: str) -> list[str]:
    return [part.strip().strip("\"'") for part in dotted.split(".")]


def _index(text: str) -> dict[Key, int]:
    found: dict[Key, int] = {}
    counts: dict[Key, int] = {}
    table: Key = ()
    for number, line in enumerate(text.splitlines(), start=1):
        header = _TABLE.match(line)
        if header:
            path: Key = ()
            names = _parts(header[2])
            for depth, name in enumerate(names):
                path = (*path, name)
                if depth == len(names) - 1 and header[1] == "[[":
                    counts[path] = counts.get(path, -1) + 1
                    found.setdefault(path, number)
                    path = (*path, counts[path])
                elif path in counts:
                    path = (*path, counts[path])
            table = path
            found.setdefault(table, number)
            continue
        entry = _KEY.match(line)
        if entry:
            path = table
            for name in _parts(entry[1]):
                path = (*path, name)
                found.setdefault(path, number)
    return found
