"""Text logs: CSV in every dialect, what halsampler prints, and what halscope saves.

``halsampler`` prints a row of numbers for each sample, with the sample's number in front if it was
asked to (``-t``), and a line ``overrun`` where samples were lost. ``halscope`` writes its sampling
period in a comment, then a table with a heading; older ones write the name of the channel in front
of every value.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import LogError
from contourlab.logs.dialect import Dialect, find_dialect, is_comment, split_fields
from contourlab.logs.source import MOST_SAMPLES, Columns, Source, refuse_length

__all__ = ["open_text"]

HEAD_BYTES = 1 << 18
HEAD_LINES = 400
CHUNK = 200_000
"""Rows that are read at a time."""
OVERRUN = "overrun"
_PERIOD = re.compile(r"Sampling period is (\d{1,12}) n[sS]")
_LABELLED = re.compile(r"(?:[A-Za-z_][^\s;,]* [+-]\d+\.\d+ ?)+")
_SHOWN = 40

Values = NDArray[Any]


def open_text(
    name: str,
    head: bytes,
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
    comment: str | None = None,
) -> Source:
    """Return a text log, opened.

    Parameters
    ----------
    name
        The file.
    head
        Its first bytes.
    delimiter, decimal, header, comment
        How it is written; found if None.

    Raises
    ------
    LogError
        It is not text, or holds no table of numbers.
    """
    encoding = _encoding(head, name)
    text = head[:HEAD_BYTES].decode(encoding, errors="replace").lstrip("\ufeff")
    lines = re.split(r"\r\n|\n|\r", text)
    if len(lines) > 1 and len(head) >= HEAD_BYTES:
        lines.pop()  # cut off in the middle
    lines = lines[:HEAD_LINES]
    period = next((m for line in lines[:20] if (m := _PERIOD.search(line))), None)
    sample_time = None if period is None else int(period[1]) * 1e-9
    if period is not None and any(_LABELLED.fullmatch(line.strip()) for line in lines[1:6]):
        return _labelled(name, encoding, sample_time, lines)
    overruns = any(line.strip() == OVERRUN for line in lines)
    plain = [line for line in lines if line.strip() != OVERRUN]
    dialect = find_dialect(
        plain, name=name, delimiter=delimiter, decimal=decimal, header=header, comment=comment
    )
    # lines in front of the table are counted in the file, overruns among them
    first = _nth_without_overrun(lines, dialect.first)
    names, units = _names(dialect)
    from_sampler = overruns or (
        not dialect.heading and dialect.delimiter == " " and not dialect.comments
    )
    counter = "0" if from_sampler and _counts(plain, dialect) else None
    kind = "text"
    if period is not None:
        kind = "halscope"
    elif from_sampler:
        kind = "halsampler"
    shown = {" ": "blanks", "\t": "tabs"}.get(dialect.delimiter, repr(dialect.delimiter))
    notes = [f"text in columns separated by {shown}, decimal sign {dialect.decimal!r}"]
    if dialect.preamble:
        notes.append(f"{dialect.preamble} lines in front of the heading were passed over")
    if not dialect.heading:
        notes.append("there is no heading: columns are called by their number, from 0")

    def read(wanted: Sequence[str]) -> Columns:
        return _read(name, encoding, dialect, first, names, wanted, comment)

    return Source(
        name=name, format=kind, names=names, read=read, units=units,
        sample_time=sample_time if sample_time else None, counter=counter,
        named=bool(dialect.heading), notes=tuple(notes),
    )  # fmt: skip


def _encoding(head: bytes, name: str) -> str:
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    for encoding, zeros in (("utf-16-le", head[1:4096:2]), ("utf-16-be", head[0:4096:2])):
        if len(zeros) > 8 and zeros.count(0) > 0.9 * len(zeros) and head.count(0) < 0.6 * len(head):
            return encoding  # without the mark that should be in front
    if b"\0" in head[:4096]:
        raise LogError(
            f"{name}: is neither text nor a MAT, HDF5, netCDF or MDF4 file, as far as can be seen"
        )
    for encoding in ("utf-8-sig", "cp1252"):
        try:
            # a sign may be cut off at the end of the head
            head[: max(len(head) - 4, 0) or len(head)].decode(encoding)
        except UnicodeDecodeError as error:
            if encoding == "utf-8-sig" and error.start >= len(head) - 8:
                return encoding
            continue
        return encoding
    return "latin-1"


def _nth_without_overrun(lines: Sequence[str], count: int) -> int:
    seen = 0
    for k, line in enumerate(lines):
        if seen == count:
            return k
        seen += line.strip() != OVERRUN
    return len(lines)


def _names(dialect: Dialect) -> tuple[tuple[str, ...], dict[str, str]]:
    if not dialect.heading:
        return tuple(str(k) for k in range(dialect.width)), {}
    names: list[str] = []
    for k, title in enumerate(dialect.heading):
        base = title or f"column {k}"
        one, n = base, 2
        while one in names:  # a heading that names two columns alike
            one, n = f"{base} ({n})", n + 1
        names.append(one)
    stated = zip(names, dialect.units, strict=False)
    return tuple(names), {name: unit for name, unit in stated if unit not in ("", "-")}


def _counts(lines: Sequence[str], dialect: Dialect) -> bool:
    """Return whether the first column counts samples."""
    rows = [split_fields(line, dialect.delimiter) for line in lines[dialect.first :]]
    first = [row[0] for row in rows if len(row) >= dialect.width]
    if len(first) < 3 or dialect.width < 2 or not all(one.isdigit() for one in first):
        return False
    steps = np.diff([int(one[:18]) for one in first])
    return bool((steps > 0).all() and np.median(steps) == 1)


def _opened(name: str, encoding: str) -> TextIO:
    try:
        return Path(name).open(encoding=encoding, errors="replace", newline="")
    except OSError as error:
        raise LogError(f"{name}: cannot be read: {error.strerror}") from None


def _read(
    name: str, encoding: str, dialect: Dialect, first: int, names: tuple[str, ...],
    wanted: Sequence[str], comment: str | None,
) -> Columns:  # fmt: skip
    import pandas as pd

    places = [names.index(one) for one in wanted]
    order = np.argsort(places)
    # halsampler says in the first column that samples were lost, wanted or not
    sampled = not dialect.heading and dialect.delimiter == " "
    read = {0, *places} if sampled else set(places)
    sign = comment if comment is not None and len(comment) == 1 else "#"
    options: dict[str, Any] = {
        "sep": r"\s+" if dialect.delimiter == " " else dialect.delimiter,
        "decimal": dialect.decimal, "header": None, "usecols": sorted(read), "engine": "c",
        "names": list(range(dialect.width + dialect.trailing)), "index_col": False,
        "chunksize": CHUNK, "comment": None if comment == "" or sign == dialect.delimiter else sign,
        "low_memory": False, "skipinitialspace": True,
    }  # fmt: skip
    _refuse_long_rows(name, encoding, dialect, first, options["comment"])
    chunks: list[Values] = []
    lost: list[int] = []
    n_rows = 0
    with _opened(name, encoding) as stream:
        for _ in range(first):
            stream.readline()
        try:
            for frame in pd.read_csv(stream, **options):
                block, gaps = _numbers(frame, dialect.decimal, places, wanted, name)
                if block is None:
                    raise _wrong_text(name, encoding, dialect, first, places, wanted, comment)
                lost += [n_rows + gap - 1 for gap in gaps]
                chunks.append(block)
                n_rows += len(block)
                refuse_length(name, n_rows)
        except pd.errors.EmptyDataError:
            raise LogError(f"{name}: holds no samples") from None
        except (pd.errors.ParserError, ValueError, OverflowError) as error:
            reason = str(error).replace("\n", " ").strip()
            raise LogError(
                f"{name}: the table cannot be read: {reason} (lines counted from line {first + 1})"
            ) from None
    if n_rows == 0:
        raise LogError(f"{name}: holds no samples")
    values = np.concatenate(chunks)
    back = np.argsort(order)
    return Columns(
        {one: np.ascontiguousarray(values[:, back[k]]) for k, one in enumerate(wanted)},
        np.array([row for row in lost if row >= 0], int),
    )


def _numbers(
    frame: Any, decimal: str, places: Sequence[int], wanted: Sequence[str], name: str
) -> tuple[Values, list[int]] | tuple[None, list[int]]:
    """Return a chunk as floats and where samples were lost; None where something is no number."""
    import pandas as pd

    columns: dict[int, Values] = {}
    bad = np.zeros(len(frame), bool)
    for place in frame.columns:
        column = frame[place]
        if place not in places:
            if not pd.api.types.is_numeric_dtype(column.dtype):
                bad |= (column.astype(str).str.strip() == OVERRUN).to_numpy()
            continue
        if pd.api.types.is_numeric_dtype(column.dtype):
            columns[place] = column.to_numpy(float, na_value=np.nan)
            continue
        text = column.astype("object").where(column.notna(), None)
        absent = text.isna().to_numpy()
        words = text.fillna("").astype(str).str.strip()
        if decimal == ",":
            words = words.str.replace(",", ".", regex=False)
        values = pd.to_numeric(words.where(words != "", "nan"), errors="coerce").to_numpy(float)
        lower = words.str.lower()
        blank = lower.isin(["", "nan", "na", "null", "none", "-", "n/a", "inf", "-inf", "+inf"])
        wrong = np.isnan(values) & ~absent & ~blank.to_numpy()
        moments = _instants(words) if wrong.any() and wrong.mean() > 0.5 else None
        if moments is not None:
            values, wrong = moments, np.zeros(len(frame), bool)
        columns[place] = values
        bad |= wrong
    gaps = [int(k) for k in np.flatnonzero(_overruns(frame, bad))] if bad.any() else []
    bad[gaps] = False
    if bad.any():
        return None, []
    block = np.column_stack([columns[place] for place in sorted(places)])
    if gaps:
        keep = np.ones(len(block), bool)
        keep[gaps] = False
        block = block[keep]
        gaps = [gap - k for k, gap in enumerate(gaps)]
    with np.errstate(all="ignore"):
        block[~np.isfinite(block)] = np.nan
    return block, gaps


def _overruns(frame: Any, bad: Values) -> Values:
    """Return which of the bad rows are halsampler's line for lost samples."""
    found = np.zeros(len(frame), bool)
    rows = frame[bad].astype("object").astype(str)
    found[bad] = (rows == OVERRUN).any(axis=1).to_numpy()
    return found


def _instants(words: Any) -> Values | None:
    """Return dates or times of day as seconds, None if they are none."""
    import pandas as pd

    try:
        # one zero for all chunks; seconds from there keep 15 ns in a float
        zero = pd.Timestamp("2020-01-01", tz="UTC")
        found = pd.to_datetime(words, format="ISO8601", errors="raise", utc=True) - zero
    except (ValueError, TypeError, OverflowError):
        try:
            found = pd.to_timedelta(words, errors="raise")
        except (ValueError, TypeError, OverflowError):
            return None
    return np.asarray(found.dt.total_seconds(), float)


def _rows(name: str, encoding: str, first: int, comment: str | None) -> Iterator[tuple[int, str]]:
    with _opened(name, encoding) as stream:
        for number, line in enumerate(stream, 1):
            if number > first and not is_comment(line, comment):
                yield number, line.rstrip("\r\n")


def _wrong_text(
    name: str, encoding: str, dialect: Dialect, first: int, places: Sequence[int],
    wanted: Sequence[str], comment: str | None,
) -> LogError:  # fmt: skip
    """Return the error that names the line of the first field that is no number."""
    import pandas as pd

    for number, line in _rows(name, encoding, first, comment):
        fields = split_fields(line, dialect.delimiter)
        if line.strip() == OVERRUN:
            continue
        for place, title in zip(places, wanted, strict=True):
            field = fields[place] if place < len(fields) else ""
            plain = field.replace(",", ".") if dialect.decimal == "," else field
            if not field or field.lower() in ("nan", "na", "null", "none", "-", "n/a"):
                continue
            if np.isnan(pd.to_numeric(pd.Series([plain]), errors="coerce").iloc[0]):
                shown = field if len(field) <= _SHOWN else f"{field[:_SHOWN]}..."
                return LogError(f"{name}:{number}: column {title!r} is {shown!r}, not a number")
    return LogError(f"{name}: a column holds something that is not a number")


def _refuse_long_rows(
    name: str, encoding: str, dialect: Dialect, first: int, sign: str | None
) -> None:
    """Raise LogError at a line with more fields than the table has columns: it would be shifted."""
    most = dialect.width + dialect.trailing
    blanks = dialect.delimiter == " "
    for number, line in _rows(name, encoding, first, sign):
        count = len(line.split()) if blanks else line.count(dialect.delimiter) + 1
        if count <= most:
            continue
        fields = split_fields(line.partition(sign)[0] if sign else line, dialect.delimiter)
        if any(fields[most:]):
            raise LogError(
                f"{name}:{number}: has {len(fields)} fields, the table has {dialect.width} columns"
            )


def _labelled(name: str, encoding: str, sample_time: float | None, lines: Sequence[str]) -> Source:
    """Return what an older halscope saved: the name of the channel in front of every value."""
    row = next(line for line in lines[1:] if _LABELLED.fullmatch(line.strip()))
    names = tuple(dict.fromkeys(row.split()[::2]))

    def read(wanted: Sequence[str]) -> Columns:
        places = [2 * names.index(one) + 1 for one in wanted]
        labels = [2 * names.index(one) for one in wanted]
        rows: list[list[float]] = []
        for number, line in _rows(name, encoding, 1, None):
            fields = line.split()
            try:
                if [fields[k] for k in labels] != list(wanted):
                    raise ValueError
                rows.append([float(fields[k]) for k in places])
            except (ValueError, IndexError):
                if len(fields) >= 2 * len(names):
                    raise LogError(f"{name}:{number}: is not a row of {', '.join(names)}") from None
            if len(rows) > MOST_SAMPLES:
                refuse_length(name, len(rows))
        if not rows:
            raise LogError(f"{name}: holds no samples")
        values = np.array(rows)
        values[~np.isfinite(values)] = np.nan
        return Columns({one: values[:, k].copy() for k, one in enumerate(wanted)})

    return Source(
        name=name, format="halscope", names=names, read=read,
        sample_time=sample_time if sample_time else None,
        notes=("written by halscope, channels named in every line",),
    )  # fmt: skip
