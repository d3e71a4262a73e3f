"""Reads points, from a text table or an array, into a part.

The unit of the coordinates is never assumed: it is given, or the heading names it, as in ``x_mm``,
``x [mm]`` or ``x (mm)``. Points become a polyline, of which every joint that turns is a corner; or
a spline through them; or a spline from which no point is further than a tolerance. What was left
out and how far the points are from the path is in the part, and in its warnings.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contourlab.contours.files import metres, read_bytes, unit_size
from contourlab.contours.interpolation import (
    PARAMETRISATIONS,
    SplineFit,
    interpolating_spline,
    smoothing_spline,
)
from contourlab.contours.joints import piece_ends
from contourlab.contours.part import Part
from contourlab.contours.path import Path
from contourlab.contours.points.cleaning import Cleaning, cleaned
from contourlab.contours.points.table import Table, read_table
from contourlab.errors import ConfigurationError, GeometryError, PartError, UnitError, choices
from contourlab.units import DIMENSIONS, to_um

__all__ = ["PointsPart", "read_points"]

SPACING = 1e-9
"""Least distance between neighbours, where none is asked for: what a path takes for one point [m].
"""
MOST_POINTS = 5_000_000
LARGEST_COORDINATE = 1e5
"""Coordinates beyond this are no machine's [m]."""

_UNIT = re.compile(r"\s*(.*?)\s*(?:_|[\[(/]|\s)\s*([^\s\[\](),_/]+)\s*[\])]?\s*")
_OTHER_UNITS = frozenset(
    symbol for what, symbols in DIMENSIONS.items() if what != "length" for symbol in symbols
) - frozenset(DIMENSIONS["length"])
"""Units of time, force and the like, which no coordinate has."""

Rows = NDArray[Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class PointsPart(Part):
    """A part made of points; it has no feeds of its own."""

    points: Float[np.ndarray, "n_points n_axes"] = field(repr=False)
    """The points that were kept [m]."""
    cleaning: Cleaning
    """What was left out, and how the points lie."""
    fits: tuple[SplineFit, ...] = field(default=(), repr=False)
    """The splines, one for each stretch between corners; empty for a polyline."""

    @property
    def fit_error_max(self) -> float:
        """Greatest distance of a kept point from the path [m]; 0 for a polyline."""
        return max((fit.max_error for fit in self.fits), default=0.0)

    @property
    def fit_error_rms(self) -> float:
        """Root of the mean square of these distances [m]."""
        if not self.fits:
            return 0.0
        return float(np.sqrt(np.mean(np.concatenate([f.distances for f in self.fits]) ** 2)))


def read_points(
    source: str | os.PathLike[str] | Any,
    *,
    unit: str | None = None,
    axes: Sequence[str] | None = None,
    columns: Sequence[int | str] | None = None,
    spline: bool = False,
    tolerance: float | str | None = None,
    degree: int = 3,
    parametrisation: str = "centripetal",
    corner_angle: float | None = None,
    closed: bool = False,
    spacing: float | str = SPACING,
    blend: float | str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
    comment: str = "#",
) -> PointsPart:
    """Return the part that points describe.

    Parameters
    ----------
    source
        A text table, a ``.npy`` file, or an array of shape (n_points, n_axes).
    unit
        Of the coordinates: ``"mm"``, ``"m"``, ``"in"``, ...; needed unless the heading names it.
    axes
        Names of the coordinates. Where the heading has columns of these names, these are read. If
        None, the names of the columns, or X, Y, Z in turn.
    columns
        Which columns are the coordinates: numbers from 0, or names of the heading.
    spline
        Whether a spline is laid through the points; else they are joined by lines.
    tolerance
        Greatest distance of a point from the spline, a number [m] or a text with its unit; without
        it the spline goes through every point.
    degree, parametrisation
        Of the spline, see :func:`~contourlab.contours.interpolating_spline`.
    corner_angle
        Points at which the polyline turns by more than this [rad] stay corners: a spline ends
        there and another begins.
    closed
        Whether the last point is joined to the first.
    spacing
        Points nearer than this to the one before are left out, a number [m] or a text.
    blend
        Tolerance within which corners may be rounded when the feed is planned, as by G64 P: a
        number [m] or a text. None stops at them.
    delimiter, decimal, header, comment
        Of a text table; see :func:`~contourlab.contours.points.table.read_table`.

    Raises
    ------
    PartError
        The file cannot be read or a line of it is wrong: file and line. No path is left.
    UnitError
        The unit is missing, or contradicts the heading.
    ConfigurationError
        An option that is not allowed.
    """
    _check_options(spline, tolerance, degree, parametrisation, corner_angle)
    least = metres(spacing, "spacing")
    within = np.nan if blend is None else metres(blend, "blend")
    allowed = None if tolerance is None else metres(tolerance, "tolerance")
    name, lines, table = _table(
        source, delimiter=delimiter, decimal=decimal, header=header, comment=comment,
        columns=columns, axes=axes,
    )  # fmt: skip
    names = tuple(axes) if axes is not None else _names(table)
    if len(names) != table.values.shape[1]:
        raise PartError(
            f"{name}: has {table.values.shape[1]} columns, and axes {names!r} are "
            f"{len(names)}: say which with columns"
        )
    if len({one.lower() for one in names}) != len(names):
        raise PartError(f"{name}: the axes must have different names, got {names!r}")
    if columns is None:
        _refuse_other_units(table.heading, name)
    scale = _scale(table.heading, unit, name)
    points = table.values * scale
    wrong = ~(np.abs(points) <= LARGEST_COORDINATE).all(axis=1)
    if wrong.any():
        at = int(np.argmax(wrong))
        raise PartError(
            f"{name}:{table.line[at]}: a coordinate is not finite or beyond "
            f"{LARGEST_COORDINATE:g} m"
        )
    points, line, cleaning = cleaned(points, table.line, least, name)
    if closed and len(points) > 1 and np.linalg.norm(points[-1] - points[0]) < least:
        points, line = points[:-1], line[:-1]  # the seam is one point
    if closed and len(points) < 3:
        raise PartError(f"{name}: a closed path needs three points or more, got {len(points)}")
    try:
        path, fits = _path(
            points, line, spline, allowed, degree, parametrisation, corner_angle, closed
        )
    except GeometryError as error:
        raise PartError(f"{name}: {error}") from None
    if fits:  # a piece comes from the point that is next to its start
        line = line[cKDTree(points).query(piece_ends(path, at_end=False)[0])[1]]
    part = _part(path, fits, points, cleaning, names, name, lines, line)
    return replace(part, blend=np.full(part.n_pieces, within))


def _check_options(
    spline: bool, tolerance: Any, degree: Any, parametrisation: str, corner_angle: Any
) -> None:
    if not isinstance(spline, bool):
        raise ConfigurationError(f"spline must be True or False, got {spline!r}")
    if tolerance is not None and not spline:
        raise ConfigurationError("tolerance goes with spline = True: lines go through every point")
    if corner_angle is not None:
        if not spline:
            raise ConfigurationError(
                "corner_angle goes with spline = True: with lines every joint is a corner"
            )
        if not isinstance(corner_angle, int | float) or not 0.0 < corner_angle < np.pi:
            raise ConfigurationError(f"corner_angle must be > 0 and < pi rad, got {corner_angle!r}")
    if isinstance(degree, bool) or not isinstance(degree, int) or not 1 <= degree <= 5:
        raise ConfigurationError(f"degree must be a whole number from 1 to 5, got {degree!r}")
    if parametrisation not in PARAMETRISATIONS:
        raise ConfigurationError(
            f"unknown parametrisation {parametrisation!r}; "
            + choices(parametrisation, PARAMETRISATIONS)
        )


def _table(
    source: Any, *, columns: Sequence[int | str] | None, axes: Sequence[str] | None,
    **options: Any,
) -> tuple[str, tuple[str, ...], Table]:  # fmt: skip
    """Return name, text and numbers of a source, the wanted columns of them."""
    if not isinstance(source, str | os.PathLike):
        return _of_array("points", _as_array(source), columns)
    name = os.fspath(source)
    data = read_bytes(name)
    if data[:6] == b"\x93NUMPY":
        return _of_array(name, _npy(data, name), columns)
    wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    text = data.decode("utf-16" if wide else "utf-8-sig", errors="replace")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if len(lines) > MOST_POINTS:
        raise PartError(f"{name}: has more than {MOST_POINTS} lines")
    table = read_table(lines, name=name, columns=[], **options)
    picked = _columns(table.heading, columns, axes, name)
    table = read_table(lines, name=name, columns=picked, **options)
    if picked is not None and table.heading:
        kept = tuple(table.heading[k] for k in picked)
        table = Table(table.values, table.line, kept, table.delimiter, table.decimal)
    return name, tuple(lines), table


def _columns(
    heading: tuple[str, ...], columns: Sequence[int | str] | None, axes: Sequence[str] | None,
    name: str,
) -> list[int] | None:  # fmt: skip
    """Return which columns are coordinates, None for all of them."""
    plain = [_split_unit(title)[0].lower() for title in heading]
    if columns is not None:
        picked = []
        for column in columns:
            if isinstance(column, str):
                wanted = column.lower()
                titles = [title.lower() for title in heading]
                if wanted not in plain and wanted not in titles:
                    raise PartError(f"{name}: no column {column!r}; {choices(column, heading)}")
                picked.append((plain if wanted in plain else titles).index(wanted))
            else:
                picked.append(column)
        if len(set(picked)) != len(picked) or not picked:
            raise ConfigurationError(f"columns must be different ones, got {list(columns)!r}")
        return picked
    if axes is not None and heading and all(axis.lower() in plain for axis in axes):
        return [plain.index(axis.lower()) for axis in axes]
    return None


def _as_array(source: Any) -> Rows:
    try:
        rows = np.asarray(source)
    except (TypeError, ValueError):
        rows = np.zeros(0)
    if rows.dtype.kind not in "fiu" or rows.ndim != 2:
        raise PartError(
            f"points must be numbers of shape (n_points, n_axes), got {rows.dtype} of shape "
            f"{rows.shape}"
        )
    return rows.astype(float)


def _of_array(
    name: str, rows: Rows, columns: Sequence[int | str] | None
) -> tuple[str, tuple[str, ...], Table]:
    if columns is not None:
        picked = _columns((), columns, None, name) or []
        for column in picked:
            if (
                isinstance(column, bool)
                or not isinstance(column, int)
                or not (0 <= column < rows.shape[1])
            ):
                raise PartError(f"{name}: has no column {column!r}, only 0 to {rows.shape[1] - 1}")
        rows = rows[:, picked]
    if len(rows) == 0 or rows.shape[1] == 0:
        raise PartError(f"{name}: has no points")
    if len(rows) > MOST_POINTS:
        raise PartError(f"{name}: has more than {MOST_POINTS} points")
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        at = int(np.argmin(finite))
        raise PartError(f"{name}:{at + 1}: row {at} is {rows[at]}, which is not finite")
    lines = tuple(f"row {k}" for k in range(len(rows)))
    line = np.arange(1, len(rows) + 1, dtype=np.int32)
    return name, lines, Table(rows, line, (), "", ".")


def _npy(data: bytes, name: str) -> Rows:
    """Return the array of a .npy file, which cannot hold objects nor claim more than it has."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read = {(1, 0): np.lib.format.read_array_header_1_0,
                (2, 0): np.lib.format.read_array_header_2_0}.get(version)  # fmt: skip
        if read is None:
            raise PartError(f"{name}: is a .npy file of version {version}, not 1.0 or 2.0")
        shape, fortran, kind = read(stream)
    except (ValueError, TypeError, KeyError, SyntaxError, EOFError, OverflowError,
            RecursionError, MemoryError):  # fmt: skip
        raise PartError(f"{name}: is not a valid .npy file") from None
    if kind.kind not in "fiu" or len(shape) != 2 or min(shape) < 0:
        raise PartError(
            f"{name}: must hold numbers of shape (n_points, n_axes), got {kind} of shape {shape}"
        )
    count = int(shape[0]) * int(shape[1])
    if count * kind.itemsize != len(data) - stream.tell():
        raise PartError(f"{name}: does not have the size that it claims, {shape}")
    rows = np.frombuffer(data, kind, count, stream.tell())
    with np.errstate(all="ignore"):
        return rows.reshape(shape, order="F" if fortran else "C").astype(float)


def _split_unit(title: str) -> tuple[str, str | None]:
    """Return a column's name and its unit, None if it names none."""
    match = _UNIT.fullmatch(title)
    if match and match[2] in DIMENSIONS["length"] and match[1]:
        return match[1], match[2]
    return title.strip(), None


def _refuse_other_units(heading: tuple[str, ...], name: str) -> None:
    for title in heading:
        match = _UNIT.fullmatch(title)
        if match and match[1] and match[2] in _OTHER_UNITS:
            raise UnitError(
                f"{name}: column {title!r} is in {match[2]}, which is no length: say with columns "
                "which ones are the coordinates"
            )


def _names(table: Table) -> tuple[str, ...]:
    if table.heading:
        return tuple(_split_unit(title)[0] for title in table.heading)
    n = table.values.shape[1]
    return tuple("XYZ"[:n]) if n <= 3 else tuple(f"axis{k}" for k in range(n))


def _scale(heading: tuple[str, ...], unit: str | None, name: str) -> Any:
    named = [_split_unit(title)[1] for title in heading]
    known = {one for one in named if one is not None}
    if unit is None:
        if not heading or None in named:
            raise UnitError(
                f"{name}: the unit of the coordinates is not known: give unit, such as 'mm', or "
                "name it in the heading, as x_mm or x [mm]"
            )
        return np.array([DIMENSIONS["length"][str(one)] for one in named])
    size = unit_size(unit)
    for one in known:
        if DIMENSIONS["length"][one] != size:
            raise UnitError(f"{name}: unit is {unit!r}, but the heading says {one!r}")
    return size


def _path(
    points: Rows, line: Rows, spline: bool, tolerance: float | None, degree: int,
    parametrisation: str, corner_angle: float | None, closed: bool,
) -> tuple[Path, tuple[SplineFit, ...]]:  # fmt: skip
    if not spline:
        return Path.polyline(points, line if closed else line[:-1], closed=closed), ()
    corners = _corners(points, corner_angle, closed)
    if closed and len(corners) == 0:
        stretches, whole = [points], True
    else:
        whole = False
        if closed:  # begin at a corner
            points = np.roll(points, -corners[0], axis=0)
            corners = corners - corners[0]
            points = np.concatenate([points, points[:1]])
            corners = corners[1:]
        edges = [0, *corners, len(points) - 1]
        stretches = [points[a : b + 1] for a, b in pairwise(edges)]
    fits = []
    for stretch in stretches:
        # between near corners there may be few points
        least = degree if whole else min(degree, len(stretch) - 1)
        options: dict[str, Any] = {
            "degree": least, "closed": whole, "parametrisation": parametrisation,
        }  # fmt: skip
        fits.append(
            interpolating_spline(stretch, **options)
            if tolerance is None or len(stretch) <= degree
            else smoothing_spline(stretch, tolerance=tolerance, **options)
        )
    return Path.join([fit.spline for fit in fits], closed=closed), tuple(fits)


def _corners(points: Rows, angle: float | None, closed: bool) -> Any:
    if angle is None:
        return np.zeros(0, int)
    around = np.concatenate([points[-1:], points, points[:1]]) if closed else points
    steps = np.diff(around, axis=0)
    direction = steps / np.linalg.norm(steps, axis=1)[:, None]
    difference = np.linalg.norm(direction[1:] - direction[:-1], axis=1)
    total = np.linalg.norm(direction[1:] + direction[:-1], axis=1)
    turns = 2.0 * np.arctan2(difference, total)
    return np.flatnonzero(turns > angle) + (0 if closed else 1)


def _part(
    path: Path, fits: tuple[SplineFit, ...], points: Rows, cleaning: Cleaning,
    names: tuple[str, ...], name: str, lines: tuple[str, ...], line: Rows,
) -> PointsPart:  # fmt: skip
    n = path.n_pieces
    part = PointsPart(
        path=path, axes=names, source=name, lines=lines,
        source_line=np.asarray(line[:n], np.int32), feed=np.full(n, np.nan),
        rapid=np.zeros(n, bool), blend=np.full(n, np.nan), dwell=np.zeros(n),
        warnings=cleaning.sentences(), points=points, cleaning=cleaning, fits=fits,
    )  # fmt: skip
    if not fits:
        return part
    said = (
        f"the spline is up to {to_um(part.fit_error_max)} um from the points, "
        f"{to_um(part.fit_error_rms)} um rms"
    )
    return replace(part, warnings=(*part.warnings, said))
