"""From the runs of a drawing to a part."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from contourlab.contours.cad.chains import chains_of, chosen, moves_of
from contourlab.contours.cad.segments import MOST_SEGMENTS, Run, check_size
from contourlab.contours.files import metres
from contourlab.contours.part import Part, axis_columns, make_part
from contourlab.contours.path import Path
from contourlab.errors import ConfigurationError, GeometryError, PartError, choices

__all__ = ["Drawing", "missing_extra"]


class Drawing:
    """What is read of a drawing, entity by entity.

    Parameters
    ----------
    path
        The file.
    axes
        Coordinates of the contour, of X, Y, Z.
    chain, reverse
        Which chain, from 0, and whether it is run the other way.
    gap
        Ends nearer than this meet, a number [m] or a text.
    blend
        Tolerance within which corners may be rounded, a number [m] or a text; None to stop at them.

    Raises
    ------
    ConfigurationError
        An option that is not allowed.
    """

    def __init__(
        self, path: str | os.PathLike[str], *, axes: Sequence[str], chain: int | None,
        reverse: bool, gap: float | str, blend: float | str | None,
    ) -> None:  # fmt: skip
        self.name = os.fspath(path)
        self.columns = axis_columns(axes)
        """Which of X, Y, Z the axes are."""
        if not isinstance(reverse, bool):
            raise ConfigurationError(f"reverse must be True or False, got {reverse!r}")
        self._axes, self._chain, self._reverse = axes, chain, reverse
        self._gap = metres(gap, "gap")
        self._blend = np.nan if blend is None else metres(blend, "blend")
        self.runs: list[Run] = []
        self.entities: list[str] = []
        """What each entity is, in a few words."""
        self.ignored: Counter[str] = Counter()
        self.dropped = 0
        """Segments of no length."""
        self.warnings: list[str] = []
        self._count = 0

    def entity(self, description: str) -> int:
        """Return the number, from 1, of another entity.

        Parameters
        ----------
        description
            What it is and where.
        """
        self.entities.append(description)
        return len(self.entities)

    def add(self, segments: Sequence[Any], entity: int, layer: str = "") -> None:
        """Add segments that belong together.

        Parameters
        ----------
        segments
            Each begins where the one before ends.
        entity
            Which entity they come from.
        layer
            Where it lies.

        Raises
        ------
        PartError
            A number that is not finite or beyond any machine; too many segments.
        """
        check_size(segments, f"{self.name}: {self.entities[entity - 1]}")
        kept = [one for one in segments if one.length > 0.0]
        self.dropped += len(segments) - len(kept)
        self._count += len(kept)
        if self._count > MOST_SEGMENTS:
            raise PartError(f"{self.name}: has more than {MOST_SEGMENTS} segments")
        if kept:
            self.runs.append(Run(kept, entity, layer))

    def part(self) -> Part:
        """Return the part.

        Raises
        ------
        PartError
            Nothing to follow; several chains and none chosen; a curve with a cusp.
        """
        chains = chains_of(self.runs, self._gap, self.name)
        one = chosen(chains, self._chain, self._reverse, self.name)
        try:
            part = make_part(
                moves_of(one), axes=self._axes, source=self.name, lines=self.entities,
                warnings=self._said(),
            )  # fmt: skip
            part = replace(part, blend=np.full(part.n_pieces, self._blend))
            if one.closed:
                part = replace(part, path=_closed(part.path))
        except GeometryError as error:
            raise PartError(f"{self.name}: {error}") from None
        return part

    def _said(self) -> list[str]:
        said = list(self.warnings)
        if self.ignored:
            kinds = ", ".join(f"{kind} ({count})" for kind, count in sorted(self.ignored.items()))
            said.append(f"entities that are no path were left out: {kinds}")
        if self.dropped:
            said.append(f"{self.dropped} segments of no length were left out")
        return said


def _closed(path: Path) -> Path:
    """Return the same pieces as a path that goes round."""
    return Path.join([path], closed=True)


def missing_extra(package: str, what: str) -> ConfigurationError:
    """Return the error of a package that is not installed.

    Parameters
    ----------
    package
        Its name.
    what
        What it is needed for.
    """
    return ConfigurationError(
        f"{what} needs {package}, which is not installed: pip install contourlab[cad]"
    )


def check_names(source: str, what: str, names: Sequence[str], known: Mapping[str, Any]) -> None:
    """Raise PartError unless all names are known ones.

    Parameters
    ----------
    source
        The file.
    what
        Of what they are names.
    names, known
        As asked, as there are.
    """
    for one in names:
        if one not in known:
            raise PartError(f"{source}: has no {what} {one!r}; {choices(one, known)}")
