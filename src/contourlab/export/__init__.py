"""From Python to the machine: a control law as C99, and what is made of it.

The same ``init`` and ``step`` that are simulated are traced once and written as C, statement by
statement. What runs on the machine is what was judged.

The package can be called: ``contourlab.export(...)`` is the function
:func:`~contourlab.export.exporting.export`.
"""

import sys
from types import ModuleType
from typing import Any

from contourlab.export.c_engine import CEngine
from contourlab.export.compiled import CompiledController, compile_c, find_compiler
from contourlab.export.engine_parity import (
    EngineParity,
    compare_engines,
    parity_of_recordings,
)
from contourlab.export.exporting import ExportResult, export
from contourlab.export.fields import Field
from contourlab.export.generate import GeneratedC, generate
from contourlab.export.golden import RecordedLoop, record_loop
from contourlab.export.parity import Parity, check_parity

__all__ = [
    "CEngine",
    "CompiledController",
    "EngineParity",
    "ExportResult",
    "Field",
    "GeneratedC",
    "Parity",
    "RecordedLoop",
    "check_parity",
    "compare_engines",
    "compile_c",
    "export",
    "find_compiler",
    "generate",
    "parity_of_recordings",
    "record_loop",
]


class _Callable(ModuleType):
    """A package that is also the function of its name: both are called ``export``."""

    def __call__(self, *arguments: Any, **options: Any) -> ExportResult:
        return export(*arguments, **options)


sys.modules[__name__].__class__ = _Callable
