"""Contours of any kind end to end as one path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from contourlab.contours.base import Contour
from contourlab.contours.fitting import enters_exactly, fitted_path
from contourlab.contours.joints import piece_ends
from contourlab.contours.path import Path
from contourlab.contours.path_rows import JOIN_TOLERANCE, joined_fields
from contourlab.errors import GeometryError

__all__ = ["Joined", "join"]

_MEETS = 1e-9
"""Ends nearer than this meet, whatever the size of the coordinates [m]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Joined:
    """A path made of contours, and how closely it follows each."""

    path: Path
    first_piece: Int[np.ndarray, " n_contours"]
    """First piece of ``path`` that belongs to each contour."""
    reached: Float[np.ndarray, " n_contours"]
    """Greatest distance from each contour [m], measured; 0 for those that a path holds exactly."""
    gaps: Float[np.ndarray, " n_joints"]
    """Distance of each end from the start that follows it [m]; the seam of a closed path last."""


def join(
    contours: Sequence[Contour], *, tolerance: float | None = None, closed: bool = False
) -> Joined:
    """Return several contours end to end.

    Paths enter as they are; lines, arcs, circles, helices, ellipses, B-splines and NURBS exactly;
    any other contour within a tolerance, which must then be given.

    Parameters
    ----------
    contours
        Each begins where the one before ends.
    tolerance
        Greatest distance from contours that a path cannot hold exactly, > 0 [m].
    closed
        Whether the end of the last is the start of the first.

    Raises
    ------
    GeometryError
        None given; different numbers of axes; ends that do not meet: which, where, and by how much;
        a tolerance that is missing, not > 0, or cannot be met.
    """
    contours = list(contours)
    if not contours:
        raise GeometryError("a path needs one contour or more")
    names = [f"contour {k} ({type(contour).__name__})" for k, contour in enumerate(contours)]
    for name, contour in zip(names, contours, strict=True):
        if not isinstance(contour, Contour):
            raise GeometryError(f"{name} is not a contour")
        if contour.n_axes != contours[0].n_axes:
            raise GeometryError(
                f"{name} has {contour.n_axes} axes, but {names[0]} has {contours[0].n_axes}"
            )
        if tolerance is None and not enters_exactly(contour):
            raise GeometryError(
                f"{name} enters a path within a tolerance only: tolerance is missing"
            )
    paths, reached = [], []
    for name, contour in zip(names, contours, strict=True):
        try:
            path, distance = fitted_path(contour, 1.0 if tolerance is None else tolerance)
        except GeometryError as error:
            raise GeometryError(f"{name}: {error}") from None
        paths.append(path)
        reached.append(distance)
    gaps = _gaps(paths, names, closed)
    counts = [path.n_pieces for path in paths]
    return Joined(
        path=Path(**joined_fields(paths, closed)),
        first_piece=np.cumsum([0, *counts[:-1]]),
        reached=np.array(reached),
        gaps=gaps,
    )


def _gaps(paths: list[Path], names: list[str], closed: bool) -> Any:
    starts = np.stack([piece_ends(path, at_end=False)[0][0] for path in paths])
    ends = np.stack([piece_ends(path, at_end=True)[0][-1] for path in paths])
    following = np.concatenate([starts[1:], starts[:1]]) if closed else starts[1:]
    gaps = np.linalg.norm(following - ends[: len(following)], axis=1)
    size = max(float(np.max(np.abs(starts))), float(np.max(np.abs(ends))))
    allowed = max(JOIN_TOLERANCE * size, _MEETS)
    if len(gaps) and gaps.max() > allowed:
        k = int(np.argmax(gaps))
        raise GeometryError(
            f"{names[k]} ends at {_shown(ends[k])} m, {gaps[k]:.3g} m away from the start of "
            f"{names[(k + 1) % len(names)]} at {_shown(following[k])} m; "
            f"ends must meet within {allowed:.3g} m"
        )
    return gaps


def _shown(point: Any) -> str:
    return f"({', '.join(f'{value:.9g}' for value in point)})"
