"""Any contour, cut into cells."""

from __future__ import annotations

import equinox as eqx

from contourlab.contours.base import Contour
from contourlab.contours.foot_points.cells import Cells
from contourlab.contours.foot_points.formula_cells import FormulaCells, formula_tables
from contourlab.contours.foot_points.path_cells import path_cells
from contourlab.contours.path import Path

__all__ = ["cells_of"]

_tables = eqx.filter_jit(formula_tables)


def cells_of(contour: Contour) -> Cells:
    """Return a contour cut into cells, with a table of how far a formula's foot is unique.

    Traceable. Make it once, before a loop, and give it to :func:`local_foot` as the contour.

    Parameters
    ----------
    contour
        Any contour.
    """
    if isinstance(contour, Path):
        return path_cells(contour)
    return FormulaCells(contour, *_tables(contour))
