"""Reads a drawing in DXF into a part; needs ezdxf (``pip install contourlab[cad]``).

Followed exactly: LINE, ARC, CIRCLE, ELLIPSE, LWPOLYLINE and POLYLINE with bulges, SPLINE and HELIX
by their control points, of model space. Refused, because they are paths that would be missed:
blocks (INSERT), multilines, splines given by fit points alone, smoothed polylines. Everything else
is no path and is listed in the part's warnings, and so are layers that are off or frozen, and
entities that are invisible.
"""

from __future__ import annotations

import io
import logging
import math
import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.cad.drawing import Drawing, check_names, missing_extra
from contourlab.contours.cad.segments import Segment, arc, bulged, conic, curve, line
from contourlab.contours.circle import TURN
from contourlab.contours.files import read_bytes, unit_size
from contourlab.contours.knots import MOST_DEGREE, bezier_pieces, check_knots
from contourlab.contours.part import Part
from contourlab.errors import ContourlabError, GeometryError, PartError, UnitError

__all__ = ["read_dxf"]

LARGEST_FILE = 64 * 2**20
"""Bytes of a drawing; ezdxf takes some twenty times as much memory."""

GAP = 1e-6
"""Ends of entities that are nearer than this meet, where nothing else is asked [m]."""

_UNITS = {
    1: ("in", 0.0254), 2: ("ft", 0.3048), 4: ("mm", 1e-3), 5: ("cm", 1e-2), 6: ("m", 1.0),
    8: ("microinch", 2.54e-8), 9: ("mil", 2.54e-5), 10: ("yd", 0.9144), 13: ("um", 1e-6),
    14: ("dm", 0.1),
}  # fmt: skip
"""$INSUNITS: its number, the unit's name and size [m]."""

_MISSED = {
    "INSERT": "blocks are not read: explode them in the drawing program, or choose layers",
    "MLINE": "multilines are not read: explode them in the drawing program, or choose layers",
}

_SMOOTHED, _MESH = 2 | 4, 16 | 64
"""Flags of a POLYLINE: a curve or spline was laid through it; it is a mesh."""

Rows = NDArray[Any]


def read_dxf(
    path: str | os.PathLike[str],
    *,
    layers: Sequence[str] | None = None,
    unit: str | None = None,
    axes: Sequence[str] = ("X", "Y"),
    chain: int | None = None,
    reverse: bool = False,
    gap: float | str = GAP,
    blend: float | str | None = None,
) -> Part:
    """Return the part that a drawing shows.

    Entities whose ends meet form a chain, in order; it runs the way its first entity was drawn.
    Pieces carry the number of their entity in the place of a line.

    Parameters
    ----------
    path
        The file, text or binary.
    layers
        Names of the layers that are read, upper or lower case; all that are on and not frozen if
        None.
    unit
        What one drawing unit is, ``"mm"`` or ``"0.1 in"``; the file's own ($INSUNITS) if None.
    axes
        Coordinates of the contour, two or three of X, Y, Z. Geometry in another one is refused.
    chain
        Which chain, from 0, if there are several that do not meet.
    reverse
        Whether it is run the other way.
    gap
        Ends nearer than this meet, half way; a number [m] or a text with its unit.
    blend
        Tolerance within which corners may be rounded when the feed is planned, as by G64 P: a
        number [m] or a text. None stops at them.

    Raises
    ------
    PartError
        The file cannot be read, nothing in it can be followed, an entity is refused, or several
        chains do not meet and none was chosen.
    UnitError
        The drawing has no unit and none was given.
    ConfigurationError
        An option that is not allowed; ezdxf is not installed.
    """
    drawing = Drawing(path, axes=axes, chain=chain, reverse=reverse, gap=gap, blend=blend)
    document, fixes = _document(read_bytes(drawing.name, LARGEST_FILE), drawing.name)
    if fixes:
        drawing.warnings.append(f"{fixes} faults of the file were mended while it was read")
    scale = _scale(document, unit, drawing)
    known = {layer.dxf.name.lower(): layer for layer in document.layers}
    entities = [(str(one.dxf.get("layer", "0")), one) for one in document.modelspace()]
    wanted: set[str] | None = None
    if layers is not None:  # the names of layers have no case
        used = {layer.lower(): layer for layer, _ in entities}
        named = {layer: layer for layer in used.values()}
        check_names(
            drawing.name, "layer", [used.get(str(one).lower(), one) for one in layers], named
        )
        wanted = {str(one).lower() for one in layers}
    hidden: set[str] = set()
    for layer, entity in entities:
        if wanted is not None and layer.lower() not in wanted:
            continue
        found = known.get(layer.lower())
        if wanted is None and found is not None and (found.is_off() or found.is_frozen()):
            hidden.add(layer)
            continue
        if entity.dxf.get("invisible", 0):
            drawing.ignored[f"{entity.dxftype()} that is invisible"] += 1
            continue
        _take(entity, layer, scale, drawing)
    if hidden:
        drawing.warnings.append(
            f"layers that are off or frozen were left out: {', '.join(sorted(hidden))}"
        )
    return drawing.part()


def _document(data: bytes, name: str) -> tuple[Any, int]:
    """Return the drawing, and how many faults of the file ezdxf mended."""
    try:
        from ezdxf import recover
    except ImportError:
        raise missing_extra("ezdxf", "a DXF file") from None
    if not data.strip():
        raise PartError(f"{name}: is empty")
    quiet = logging.getLogger("ezdxf")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)
    try:
        document, auditor = recover.read(io.BytesIO(data))
    except Exception as error:  # noqa: BLE001 - a parser of others, given any bytes
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise PartError(f"{name}: is not a DXF file that ezdxf can read: {reason}") from None
    finally:
        quiet.setLevel(level)
    if auditor.has_errors:
        first = auditor.errors[0].message
        raise PartError(f"{name}: has {len(auditor.errors)} faults, the first: {first}")
    return document, len(auditor.fixes)


def _scale(document: Any, unit: str | None, drawing: Drawing) -> float:
    said = document.header.get("$INSUNITS", 0)
    named = _UNITS.get(said)
    if unit is None:
        if named is None:
            why = "has no unit ($INSUNITS is 0)" if said == 0 else f"has the unit number {said!r}"
            raise UnitError(f"{drawing.name}: the drawing {why}: give unit, such as 'mm'")
        return named[1]
    size = unit_size(unit)
    if named is not None and not math.isclose(size, named[1], rel_tol=1e-9):
        drawing.warnings.append(f"the drawing says that its unit is {named[0]}; read as {unit}")
    return size


def _take(entity: Any, layer: str, scale: float, drawing: Drawing) -> None:
    kind = entity.dxftype()
    handle = entity.dxf.get("handle", "?")
    what = f"{kind} {handle} on layer {layer}"
    if kind in _MISSED:
        raise PartError(f"{drawing.name}: {what}: {_MISSED[kind]}")
    read = _READERS.get(kind)
    if read is None or (kind == "POLYLINE" and int(entity.dxf.get("flags", 0)) & _MESH):
        drawing.ignored[kind] += 1
        return
    number = drawing.entity(what)
    try:
        with np.errstate(all="ignore"):
            segments = read(entity, scale)
    except ContourlabError as error:
        raise PartError(f"{drawing.name}: {what}: {error}") from None
    except Exception as error:  # noqa: BLE001 - values of the file that ezdxf does not check
        raise PartError(f"{drawing.name}: {what}: cannot be read ({error})") from None
    drawing.add(segments, number, layer)


def _line(entity: Any, scale: float) -> list[Segment]:
    return [line(_vector(entity.dxf.start) * scale, _vector(entity.dxf.end) * scale)]


def _arc(entity: Any, scale: float) -> list[Segment]:
    first = math.radians(entity.dxf.start_angle)
    swept = math.radians(entity.dxf.end_angle - entity.dxf.start_angle) % TURN
    return _round(entity, scale, first, _turn_or(swept))


def _circle(entity: Any, scale: float) -> list[Segment]:
    return _round(entity, scale, 0.0, TURN)


def _round(entity: Any, scale: float, first: float, swept: float) -> list[Segment]:
    x, y, z = _frame(entity)
    radius = float(entity.dxf.radius) * scale
    if not radius > 0.0:
        raise PartError(f"its radius must be > 0, got {entity.dxf.radius}")
    center = np.stack([x, y, z], axis=1) @ _vector(entity.dxf.center) * scale

    def at(angle: float) -> Rows:
        return center + radius * (math.cos(angle) * x + math.sin(angle) * y)

    end = at(first) if swept == TURN else at(first + swept)
    return [arc(center, at(first), swept, z, end)]


def _ellipse(entity: Any, scale: float) -> list[Segment]:
    major = _vector(entity.dxf.major_axis)
    normal = _unit(_vector(entity.dxf.extrusion))
    minor = np.cross(normal, major) * float(entity.dxf.ratio)
    if not (np.linalg.norm(major) > 0.0 and np.linalg.norm(minor) > 0.0):
        raise PartError("its axes must have lengths > 0")
    start, end = float(entity.dxf.start_param), float(entity.dxf.end_param)
    swept = _turn_or((end - start) % TURN)
    center = _vector(entity.dxf.center)
    return conic(center * scale, major * scale, minor * scale, start, swept)


def _turn_or(swept: float) -> float:
    """Return an angle, but a whole turn for what is one, or none, to rounding."""
    return TURN if swept < 1e-12 or TURN - swept < 1e-12 else swept


def _lwpolyline(entity: Any, scale: float) -> list[Segment]:
    height = float(entity.dxf.get("elevation", 0.0))
    rows = [(x, y, height, bulge) for x, y, bulge in entity.get_points("xyb")]
    return _bulges(rows, _frame(entity), bool(entity.closed), scale)


def _polyline(entity: Any, scale: float) -> list[Segment]:
    if int(entity.dxf.get("flags", 0)) & _SMOOTHED:
        raise PartError("smoothed polylines are not read: explode it in the drawing program")
    points = [_vector(vertex.dxf.location) for vertex in entity.vertices]
    if entity.is_2d_polyline:
        height = _vector(entity.dxf.get("elevation", (0.0, 0.0, 0.0)))[2]
        rows = [
            (p[0], p[1], height, float(vertex.dxf.get("bulge", 0.0)))
            for p, vertex in zip(points, entity.vertices, strict=True)
        ]
        return _bulges(rows, _frame(entity), bool(entity.is_closed), scale)
    rows = [(*p, 0.0) for p in points]
    return _bulges(rows, tuple(np.eye(3)), bool(entity.is_closed), scale)


def _bulges(
    rows: Sequence[Any], frame: tuple[Rows, ...], closed: bool, scale: float
) -> list[Segment]:
    if len(rows) < 2:
        return []
    table = np.array(rows, float)
    points = table[:, :3] @ np.stack(frame) * scale
    last = len(points) if closed else len(points) - 1
    return [
        bulged(points[k], points[(k + 1) % len(points)], float(table[k, 3]), frame[2])
        for k in range(last)
    ]


def _spline(entity: Any, scale: float) -> list[Segment]:
    control = np.array([tuple(p) for p in entity.control_points], float)
    if len(control) == 0:
        raise PartError("it is given by fit points alone: convert it to control points")
    weights = np.array(list(entity.weights) or np.ones(len(control)), float)
    degree = int(entity.dxf.degree)
    if not 1 <= degree <= MOST_DEGREE:
        raise PartError(f"its degree must be 1 to {MOST_DEGREE}, got {degree}")
    if weights.shape != (len(control),) or not (weights > 0.0).all():
        raise PartError("its weights must be > 0, one for each control point")
    if not np.isfinite(control).all():
        raise PartError("its control points must be finite")
    knots = np.array(list(entity.knots), float)
    check_knots(knots, len(control), degree, False)
    homogeneous = np.concatenate([control * scale * weights[:, None], weights[:, None]], axis=1)
    pieces, _ = bezier_pieces(homogeneous, knots, degree)
    return [curve(piece) for piece in pieces]


_READERS: dict[str, Callable[[Any, float], list[Segment]]] = {
    "LINE": _line,
    "ARC": _arc,
    "CIRCLE": _circle,
    "ELLIPSE": _ellipse,
    "LWPOLYLINE": _lwpolyline,
    "POLYLINE": _polyline,
    "SPLINE": _spline,
    "HELIX": _spline,
}


def _vector(value: Any) -> Rows:
    row = np.array(tuple(value), float)
    return row if len(row) == 3 else np.append(row, 0.0)


def _unit(vector: Rows) -> Rows:
    size = np.linalg.norm(vector)
    if not (np.isfinite(size) and size > 0.0):
        raise GeometryError(f"its extrusion direction must not be zero, got {vector}")
    return vector / size  # type: ignore[no-any-return]


def _frame(entity: Any) -> tuple[Rows, Rows, Rows]:
    """Return the axes of an entity's own coordinates, by DXF's arbitrary axis algorithm."""
    z = _unit(_vector(entity.dxf.get("extrusion", (0.0, 0.0, 1.0))))
    if abs(z[0]) < 1.0 / 64.0 and abs(z[1]) < 1.0 / 64.0:
        x = np.cross([0.0, 1.0, 0.0], z)
    else:
        x = np.cross([0.0, 0.0, 1.0], z)
    x = _unit(x)
    return x, np.cross(z, x), z
