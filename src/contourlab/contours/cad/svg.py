"""Reads a drawing in SVG into a part; needs svgpathtools (``pip install contourlab[cad]``).

Followed exactly: path, line, polyline, polygon, rect, circle and ellipse, with their
transformations and those of the groups round them. Circular arcs stay arcs; elliptical ones, and
arcs that a transformation distorts, become rational Bézier curves. Refused, because they are paths
that would be missed: ``use`` and nested ``svg``. Text, images and the like are no path and are
listed in the part's warnings, and so is what is not displayed. Style sheets are not read.

SVG's y axis points down and a machine's up: y is counted from the lower edge of the page.

The document is read by expat; one that declares entities is refused, and nothing that it refers to
is opened. svgpathtools reads path data and transformations.
"""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Sequence
from typing import Any
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.cad.drawing import Drawing, check_names, missing_extra
from contourlab.contours.cad.segments import Segment
from contourlab.contours.cad.svg_shapes import PlacedShapes
from contourlab.contours.files import read_bytes, unit_size
from contourlab.contours.part import Part
from contourlab.errors import ContourlabError, PartError, UnitError

__all__ = ["read_svg"]

LARGEST_FILE = 64 * 2**20
"""Bytes of a drawing."""
GAP = 1e-6
"""Ends that are nearer than this meet, where nothing else is asked [m]."""
_DEEPEST = 200
_ABSOLUTE = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "pt": 0.0254 / 72, "pc": 0.0254 / 6,
             "Q": 0.25e-3}  # fmt: skip
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_COMMANDS = frozenset("MmZzLlHhVvCcSsQqTtAa, \t\r\n")
_SHAPES = frozenset(["path", "line", "polyline", "polygon", "rect", "circle", "ellipse"])
_GROUPS = frozenset(["svg", "g", "a", "switch"])
_MISSED = {
    "use": "copies are not read: replace them by what they stand for",
    "svg": "a drawing within a drawing is not read: take it out of there",
}
_APART = frozenset([
    "defs", "symbol", "clipPath", "mask", "marker", "pattern", "style", "script", "title", "desc",
    "metadata", "linearGradient", "radialGradient", "filter", "text", "foreignObject",
])  # fmt: skip
"""Elements whose content is not drawn where it stands."""
_QUIET = frozenset(["title", "desc", "metadata", "defs", "namedview", "style"])
_INCH_96 = 96.0
_STYLED = re.compile(
    r"(?:^|;)(transform|transform-origin|rotate|scale|translate|offset-path"
    r"|d|x|y|r|rx|ry|cx|cy|width|height|zoom):(?!none(?:;|$))"
)
"""Properties of style that move or shape what is drawn."""

Rows = NDArray[Any]


def read_svg(
    path: str | os.PathLike[str],
    *,
    unit: str | None = None,
    layers: Sequence[str] | None = None,
    axes: Sequence[str] = ("X", "Y"),
    chain: int | None = None,
    reverse: bool = False,
    gap: float | str = GAP,
    blend: float | str | None = None,
) -> Part:
    """Return the part that a drawing shows.

    Elements whose ends meet form a chain, in order; it runs the way its first element was drawn.
    Pieces carry the number of their element in the place of a line.

    Parameters
    ----------
    path
        The file.
    unit
        What one user unit is, ``"mm"`` or ``"0.1 in"``. If None, it follows from the width of the
        drawing in mm, cm, in, pt, pc or Q, and its viewBox.
    layers
        Ids, or Inkscape's labels, of the groups and shapes that are read; all if None.
    axes
        Names of the two coordinates, of X, Y, Z.
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
        The file cannot be read, nothing in it can be followed, an element is refused, or several
        chains do not meet and none was chosen.
    UnitError
        The drawing has no physical size and no unit was given.
    ConfigurationError
        An option that is not allowed; svgpathtools is not installed.
    """
    drawing = Drawing(path, axes=axes, chain=chain, reverse=reverse, gap=gap, blend=blend)
    reader = _Reader(drawing, unit, None if layers is None else tuple(layers))
    reader.parse(read_bytes(drawing.name, LARGEST_FILE))
    if layers is not None:
        check_names(drawing.name, "layer", layers, reader.seen)
    return drawing.part()


class _Refused(Exception):  # noqa: N818 - carried through expat
    """An error of ours on its way out of expat."""

    def __init__(self, error: ContourlabError) -> None:
        self.error = error


class _Reader:
    """Takes elements from expat as they open and close."""

    def __init__(self, drawing: Drawing, unit: str | None, layers: tuple[str, ...] | None) -> None:
        name, columns = drawing.name, drawing.columns
        if len(columns) != 2:
            raise PartError(f"{name}: an SVG drawing is planar: axes must be two")
        try:
            from svgpathtools import Path as SvgPath
            from svgpathtools.parser import parse_transform
        except ImportError:
            raise missing_extra("svgpathtools", "an SVG file") from None
        self.drawing = drawing
        self.seen: dict[str, None] = {}
        """Ids and labels of the document."""
        self._parse_path, self._parse_transform = SvgPath, parse_transform
        self._name, self._unit, self._layers, self._columns = name, unit, layers, columns
        self._stack: list[tuple[Rows, bool]] = []
        self._apart = 0

    def parse(self, data: bytes) -> None:
        parser = expat.ParserCreate()
        parser.buffer_text = True
        parser.StartElementHandler = self._opened
        parser.EndElementHandler = self._closed
        parser.EntityDeclHandler = self._entity
        parser.SetParamEntityParsing(expat.XML_PARAM_ENTITY_PARSING_NEVER)
        self._parser = parser
        try:
            parser.Parse(data, True)
        except _Refused as refusal:
            raise refusal.error from None
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            raise PartError(f"{self._name}:{error.lineno}: is not valid XML: {reason}") from None
        except (ValueError, LookupError, UnicodeError) as error:  # an encoding that is unknown
            raise PartError(f"{self._name}: is not valid XML: {error}") from None

    def _entity(self, *declared: Any) -> None:
        self._refuse(f"declares the entity {declared[0]!r}; entities are not read")

    def _refuse(self, message: str) -> None:
        line_ = self._parser.CurrentLineNumber
        raise _Refused(PartError(f"{self._name}:{line_}: {message}"))

    def _opened(self, tag: str, attributes: dict[str, str]) -> None:
        try:
            with np.errstate(all="ignore"):
                self._open(tag.rpartition(":")[2], attributes)
        except (_Refused, expat.ExpatError):
            raise
        except PartError as error:
            message = str(error).removeprefix(f"{self._name}: ")
            self._refuse(f"{tag}: {message}")
        except ContourlabError as error:
            raise _Refused(error) from None

    def _open(self, tag: str, attributes: dict[str, str]) -> None:
        if self._apart:
            self._apart += 1
            return
        if not self._stack:
            if tag != "svg":
                raise PartError("is not an SVG drawing")
            self._stack.append((self._page(attributes), self._layers is None))
            return
        if len(self._stack) > _DEEPEST:
            raise PartError(f"groups are nested more than {_DEEPEST} deep")
        matrix, wanted = self._stack[-1]
        for key in ("id", "inkscape:label"):
            if key in attributes:
                self.seen[attributes[key]] = None
                wanted = wanted or attributes[key] in (self._layers or ())
        style = re.sub(r"\s", "", attributes.get("style", ""))
        hidden = (
            attributes.get("display") == "none"
            or attributes.get("visibility") in ("hidden", "collapse")
            or re.search(r"(?:^|;)(?:display:none|visibility:(?:hidden|collapse))", style)
        )
        if hidden:
            self.drawing.ignored[f"{tag} that is not displayed"] += 1
        if tag in _MISSED and wanted and not hidden:
            raise PartError(_MISSED[tag])
        if hidden or tag in _APART or (tag not in _SHAPES and tag not in _GROUPS):
            if not hidden and tag not in _QUIET:
                self.drawing.ignored[tag] += 1
            self._apart = 1
            return
        moved = _STYLED.search(style)
        if wanted or tag in _GROUPS:
            if moved:
                raise PartError(f"style sets {moved[1]!r}: use an attribute, style is not read")
            if "transform-origin" in attributes:
                raise PartError("transform-origin is not read: put it into transform")
        matrix = matrix @ self._transform(attributes.get("transform", ""))
        self._stack.append((matrix, wanted))
        if tag in _SHAPES and wanted:
            self._shape(tag, attributes, matrix)

    def _closed(self, tag: str) -> None:
        del tag
        if self._apart:
            self._apart -= 1
        else:
            self._stack.pop()

    def _transform(self, text: str) -> Rows:
        if not text.strip():
            return np.eye(3)
        try:
            return np.asarray(self._parse_transform(text, strict=True), float)
        except ValueError as error:
            raise PartError(f"transform: {error}") from None

    # -- the page -----------------------------------------------------------------------------

    def _page(self, attributes: dict[str, str]) -> Rows:
        """Return the matrix from user units to metres, y up from the lower edge."""
        box = attributes.get("viewBox")
        low = np.zeros(2)
        size: Rows | None = None
        if box is not None:
            numbers = [self._number(word, "viewBox") for word in box.replace(",", " ").split()]
            if len(numbers) != 4 or not min(numbers[2:]) > 0.0:
                raise PartError(f"viewBox must be four numbers, the last two > 0, got {box!r}")
            low, size = np.array(numbers[:2]), np.array(numbers[2:])
        physical = [self._physical(attributes.get(key)) for key in ("width", "height")]
        scale = None
        if size is not None:
            scales = [
                value / user
                for value, user in zip(physical, size, strict=True)
                if value is not None
            ]
            stretched = attributes.get("preserveAspectRatio", "").strip().startswith("none")
            if stretched and len(scales) == 2 and not math.isclose(*scales, rel_tol=1e-3):
                raise PartError("preserveAspectRatio 'none' stretches the drawing: not read")
            fitted = max if attributes.get("preserveAspectRatio", "").endswith("slice") else min
            scale = fitted(scales, default=None)
        if self._unit is not None:
            asked = unit_size(self._unit)
            if scale is not None and not math.isclose(asked, scale, rel_tol=1e-3):
                self.drawing.warnings.append(
                    f"the drawing says that its unit is {1e3 * scale:.6g} mm; read as {self._unit}"
                )
            scale = asked
        if scale is None:
            raise UnitError(
                f"{self._name}: the drawing does not say how large a unit is (width in mm or in, "
                "and viewBox): give unit, such as 'mm'"
            )
        if not 0.0 < scale < 1e6:
            raise PartError(f"its unit must be > 0 m, got {scale:g}")
        height = size[1] if size is not None else self._plain(attributes.get("height"))
        matrix = np.diag([scale, -scale, 1.0])
        matrix[:2, 2] = -scale * low[0], scale * (low[1] + height)
        return matrix

    def _physical(self, text: str | None) -> float | None:
        match = re.fullmatch(rf"\s*({_NUMBER.pattern})\s*(mm|cm|in|pt|pc|Q)\s*", text or "")
        if match is None:
            return None
        value = float(match[1]) * _ABSOLUTE[match[2]]
        if not 0.0 < value < math.inf:
            raise PartError(f"width and height must be > 0, got {text!r}")
        return value

    def _plain(self, text: str | None) -> float:
        """Return a height without viewBox in user units; of px or without a unit, 0 otherwise."""
        match = re.fullmatch(rf"\s*({_NUMBER.pattern})\s*(?:px)?\s*", text or "")
        if match is not None:
            return float(match[1])
        physical = self._physical(text)
        return 0.0 if physical is None else physical / 0.0254 * _INCH_96

    def _number(self, text: str | None, key: str, default: float | None = None) -> float:
        if text is None and default is not None:
            return default
        match = re.fullmatch(rf"\s*({_NUMBER.pattern})\s*(px)?\s*", text or "")
        if match is None or not math.isfinite(float(match[1])):
            raise PartError(f"{key} must be a number of user units, got {text!r}")
        return float(match[1])

    # -- shapes -------------------------------------------------------------------------------

    def _shape(self, tag: str, attributes: dict[str, str], matrix: Rows) -> None:
        what = f'{tag} "{attributes["id"][:80]}"' if "id" in attributes else tag
        number = self.drawing.entity(f"{what} in line {self._parser.CurrentLineNumber}")
        for run in getattr(self, f"_{tag}")(attributes, PlacedShapes(matrix, self._columns)):
            self.drawing.add(run, number)

    def _line(self, a: dict[str, str], place: PlacedShapes) -> list[list[Segment]]:
        x1, y1, x2, y2 = (self._number(a.get(key), key, 0.0) for key in ("x1", "y1", "x2", "y2"))
        return [[place.line((x1, y1), (x2, y2))]]

    def _points(self, a: dict[str, str]) -> list[tuple[float, float]]:
        text = a.get("points", "")
        if _NUMBER.sub("", text).replace(",", "").strip():
            raise PartError(f"points must be numbers of user units, got {text[:80]!r}")
        numbers = [self._number(word, "points") for word in _NUMBER.findall(text)]
        if len(numbers) % 2:
            raise PartError(f"points must be pairs, got {len(numbers)} numbers")
        return list(zip(numbers[::2], numbers[1::2], strict=True))

    def _polyline(self, a: dict[str, str], place: PlacedShapes) -> list[list[Segment]]:
        return [place.lines(self._points(a))]

    def _polygon(self, a: dict[str, str], place: PlacedShapes) -> list[list[Segment]]:
        points = self._points(a)
        return [place.lines([*points, *points[:1]])]

    def _rect(self, a: dict[str, str], place: PlacedShapes) -> list[list[Segment]]:
        x, y = (self._number(a.get(key), key, 0.0) for key in ("x", "y"))
        w, h = (self._number(a.get(key), key, 0.0) for key in ("width", "height"))
        given = [a.get(key) if a.get(key) != "auto" else None for key in ("rx", "ry")]
        rx, ry = (self._number(one or other, "rx", 0.0) for one, other in (given, given[::-1]))
        if min(w, h, rx, ry) < 0.0:
            raise PartError("width, height, rx and ry must be >= 0")
        if w == 0.0 or h == 0.0:
            return []
        rx, ry = min(rx, 0.5 * w), min(ry, 0.5 * h)
        if rx == 0.0 or ry == 0.0:
            return [place.lines([(x, y), (x + w, y), (x + w, y + h), (x, y + h), (x, y)])]
        quarter = 0.5 * math.pi
        run: list[Segment] = []
        for k, (cx, cy, from_, to) in enumerate((
            (x + w - rx, y + ry, (x + rx, y), (x + w - rx, y)),
            (x + w - rx, y + h - ry, (x + w, y + ry), (x + w, y + h - ry)),
            (x + rx, y + h - ry, (x + w - rx, y + h), (x + rx, y + h)),
            (x + rx, y + ry, (x, y + h - ry), (x, y + ry)),
        )):  # fmt: skip
            run.append(place.line(from_, to))
            run += place.conic((cx, cy), (rx, 0.0), (0.0, ry), (k - 1) * quarter, quarter)
        return [run]

    def _circle(self, a: dict[str, str], place: PlacedShapes) -> list[list[Segment]]:
        r = self._number(a.get("r"), "r", 0.0)
        return self._whole(a, r, r, place)

    def _ellipse(self, a: dict[str, str], place: PlacedShapes) -> list[list[Segment]]:
        rx, ry = (self._number(a.get(key), key, 0.0) for key in ("rx", "ry"))
        return self._whole(a, rx, ry, place)

    def _whole(
        self, a: dict[str, str], rx: float, ry: float, place: PlacedShapes
    ) -> list[list[Segment]]:
        cx, cy = (self._number(a.get(key), key, 0.0) for key in ("cx", "cy"))
        if min(rx, ry) < 0.0:
            raise PartError("a radius must be >= 0")
        if min(rx, ry) == 0.0:
            return []
        return [place.conic((cx, cy), (rx, 0.0), (0.0, ry), 0.0, 2.0 * math.pi)]

    def _path(self, a: dict[str, str], place: PlacedShapes) -> list[list[Segment]]:
        data = a.get("d", "")
        rest = _NUMBER.sub(" ", data)
        if not set(rest) <= _COMMANDS:
            wrong = next(letter for letter in rest if letter not in _COMMANDS)
            raise PartError(f"path data has {wrong!r}, which is no command and no number")
        if data.strip() and data.strip()[0] not in "Mm":
            raise PartError("path data must begin with M or m")
        try:
            with warnings.catch_warnings():  # an arc of radius 0 is a line, as SVG has it
                warnings.simplefilter("ignore")
                pieces = list(self._parse_path(data))
        except Exception as error:  # noqa: BLE001 - a parser of others, given any text
            reason = str(error)[:120] or "an arc ends where it begins, or has no radius"
            raise PartError(f"path data cannot be read: {reason}") from None
        runs: list[list[Segment]] = []
        last: complex | None = None
        for piece in pieces:
            if last is None or piece.start != last:
                runs.append([])
            runs[-1] += place.piece(piece)
            last = piece.end
        return [run for run in runs if run]
