"""From Python to the machine: a control law as C99, a LinuxCNC component, an FMU.

The same ``init`` and ``step`` that are simulated are traced once and written as C, statement by
statement. What runs on the machine is what was judged.
"""

from contourlab.export.compiled import CompiledController, compile_c, find_compiler
from contourlab.export.fields import Field
from contourlab.export.generate import GeneratedC, generate

__all__ = [
    "CompiledController",
    "Field",
    "GeneratedC",
    "compile_c",
    "find_compiler",
    "generate",
]
