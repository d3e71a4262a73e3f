"""A part with its lines merged and its corners blended as its G64 asks.

Whose tolerance holds at a joint follows LinuxCNC [LinuxCNC]_: the mode in force at the earlier move
says whether there is a blend at all; its tolerance is the smaller of those of both moves (of the
earlier alone, if the later stands under an exact stop). There is none between a rapid and a feed,
nor where a dwell stands between. Rapids are blended with rapids.

References
----------
.. [LinuxCNC] ``tcSetupState``, ``tpCheckBlendArcType``, ``tcFindBlendTolerance`` and
   ``handleModeChange`` of the trajectory planner, read.
"""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Int
from numpy.typing import NDArray

from contourlab.contours.blending.corners import Blended, blend_corners
from contourlab.contours.blending.merging import Merged, merge_lines
from contourlab.contours.part import Part
from contourlab.errors import GeometryError, PartError

__all__ = ["BlendedPart", "blend_part", "joint_tolerance", "merge_part"]

_PER_PIECE = re.compile(r"""["'] ?n(?: [^"']*)?["']\]""")
"""The annotation of an array with a row for each piece."""
_OWN = ("dwell", "source_line", "file", "file_line")
"""Fields in which lines that are merged may differ."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BlendedPart:
    """A part after merging and blending, with the report."""

    part: Part
    """The new part; ``part.path`` is ``blended.path``."""
    merged: Merged | None
    """How lines were merged; None if the part asks for none."""
    blended: Blended
    """How corners were blended; its pieces and joints are those after merging."""
    piece: Int[NDArray[Any], " n_rows"]
    """Piece of the given part that each row comes from, the last of a merged run; for a blend the
    piece after its joint."""
    largest_deviation: float
    """Of all blends [m]; 0 without any."""
    largest_line: int
    """Source line of the piece after that blend's joint; 0 without any."""
    left: tuple[tuple[int, str], ...]
    """Corners that stay: source line of the piece after, and why."""

    @property
    def n_blends(self) -> int:
        """Count of blends."""
        return len(self.blended.joint)


def joint_tolerance(part: Part) -> NDArray[Any]:
    """Return the blend tolerance at each joint of a part, shape (n_joints,) [m]; NaN for none.

    Parameters
    ----------
    part
        Any part.
    """
    before, after = part.blend[:-1], part.blend[1:]
    tolerance = np.where(np.isnan(before), np.nan, np.fmin(before, after))
    tolerance[part.rapid[:-1] != part.rapid[1:]] = np.nan
    tolerance[part.dwell[:-1] > 0.0] = np.nan
    return np.append(tolerance, np.nan) if part.path.closed else tolerance


def merge_part(part: Part) -> tuple[Part, Merged | None]:
    """Return the part with its lines merged as ``part.merge`` asks, and how; see the module.

    Only lines under G64 that agree in feed and in everything else said of them are merged, and
    none over a dwell. The new part asks for no merging, so that it can be handed on to
    :func:`blend_part`.

    Parameters
    ----------
    part
        Any part; without a field ``merge`` it is returned as it is.
    """
    tolerance = getattr(part, "merge", None)
    if tolerance is None or part.n_pieces < 2:
        return part, None
    tolerance = np.where(np.isnan(part.blend) | part.rapid, np.nan, tolerance)
    if not (tolerance > 0.0).any():
        return part, None
    apart = part.dwell[:-1] > 0.0
    for name, values in _arrays(part).items():
        if name not in _OWN:
            apart = apart | _differ(values[:-1], values[1:])
    if part.path.closed:
        apart = np.append(apart, True)
    merged = merge_lines(part.path, tolerance=tolerance, apart=apart)
    done = np.full(merged.path.n_pieces, np.nan)  # once is enough: another pass would go farther
    return _mapped(part, merged.path, merged.piece_last, {"merge": done}), merged


def blend_part(part: Part, reach: Any = np.inf) -> BlendedPart:
    """Return the part with its lines merged and its corners blended.

    Parameters
    ----------
    part
        Any part.
    reach
        Longest trim at each joint of the part after :func:`merge_part`, or one for all [m]; what
        limits blends that have no tolerance.

    Returns
    -------
    BlendedPart
        The feed on a blend is the smaller of its neighbours'; a dwell stays at the end of its
        piece; a blend has all else from the piece after it.

    Raises
    ------
    GeometryError
        A negative reach or one of a wrong shape.
    PartError
        A field of the part that has a row for each piece, but not as many.
    """
    short, merged = merge_part(part)
    try:
        blended = blend_corners(short.path, tolerance=joint_tolerance(short), reach=reach)
    except GeometryError as error:
        raise GeometryError(f"{part.source}: {error}") from error
    piece, is_blend = blended.piece, blended.is_blend
    before = np.maximum(piece - 1, 0)
    feed = np.where(is_blend, np.fmin(short.feed[before], short.feed[piece]), short.feed[piece])
    # of the rows of a piece the last one ends where the piece did
    last = np.append(piece[1:] != piece[:-1], True)
    dwell = np.where(last, short.dwell[piece], 0.0)
    new = _mapped(short, blended.path, piece, {"feed": feed, "dwell": dwell})
    worst = int(np.argmax(blended.deviation)) if len(blended.joint) else -1
    lines = short.source_line
    following = (blended.left + 1) % short.n_pieces
    return BlendedPart(
        part=new,
        merged=merged,
        blended=blended,
        piece=piece if merged is None else merged.piece_last[piece],
        largest_deviation=float(blended.deviation[worst]) if worst >= 0 else 0.0,
        largest_line=int(lines[blended.joint[worst] + 1]) if worst >= 0 else 0,
        left=tuple(
            (int(line), why) for line, why in zip(lines[following], blended.reason, strict=True)
        ),
    )


def _arrays(part: Part) -> dict[str, NDArray[Any]]:
    """Return the fields of a part that have a row for each piece, by annotation or by length."""
    found = {}
    for field in dataclasses.fields(part):
        value = getattr(part, field.name)
        if not isinstance(value, np.ndarray) or value.ndim == 0:
            continue
        if not _PER_PIECE.search(str(field.type)) and len(value) != part.n_pieces:
            continue  # something else, of a length of its own
        if len(value) != part.n_pieces:
            raise PartError(
                f"{part.source}: {field.name} must have {part.n_pieces} rows, one for each piece, "
                f"got {len(value)}"
            )
        found[field.name] = value
    return found


def _differ(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    same = a == b
    if np.issubdtype(a.dtype, np.floating):
        same |= np.isnan(a) & np.isnan(b)
    return ~same.reshape(len(a), -1).all(axis=1)  # type: ignore[no-any-return]


def _mapped(part: Part, path: Any, piece: NDArray[Any], given: dict[str, NDArray[Any]]) -> Part:
    fields = {name: values[piece] for name, values in _arrays(part).items()}
    return dataclasses.replace(part, path=path, **(fields | given))
