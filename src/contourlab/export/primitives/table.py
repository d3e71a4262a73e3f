"""Which function writes which primitive; one that is not here cannot be exported."""

from __future__ import annotations

from typing import Any

from contourlab.errors import ExportError
from contourlab.export.flatten import Equation
from contourlab.export.primitives.elementwise import ELEMENTWISE, elementwise
from contourlab.export.primitives.indexing import INDEXING
from contourlab.export.primitives.loops import LOOPS
from contourlab.export.primitives.products import dot_general
from contourlab.export.primitives.reductions import REDUCTIONS
from contourlab.export.primitives.views import VIEWS

__all__ = ["HANDLERS", "handler"]

HANDLERS: dict[str, Any] = {
    **dict.fromkeys(ELEMENTWISE, elementwise),
    **VIEWS,
    **REDUCTIONS,
    **INDEXING,
    **LOOPS,
    "dot_general": dot_general,
}


def handler(equation: Equation) -> Any:
    """Return the function that writes an equation.

    Parameters
    ----------
    equation
        Of a program.

    Raises
    ------
    ExportError
        There is none; names the primitive and the line of the law that used it.
    """
    found = HANDLERS.get(equation.primitive)
    if found is None:
        raise ExportError(
            f"the primitive {equation.primitive} cannot be exported; it comes from "
            f"{equation.line or 'a line that JAX does not know'}"
        )
    return found
