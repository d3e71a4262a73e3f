"""Contouring control: designed, judged by the exact contour error, and shipped to real time.

``import contourlab`` does two things to JAX, for the whole process. It makes it compute in float64
(``jax_enable_x64``): a contour error of a micrometre on a metre is lost in float32. And it asks XLA
(in ``XLA_FLAGS``) to compile a small loop as one piece of machine code: a control step then takes a
tenth of a microsecond instead of several. The second has no effect if JAX has computed before; both
are inherited by programs started from this one.

Packages are imported when first used.
"""

from __future__ import annotations

import importlib
import os
import sys
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_PACKAGES = (
    "configuration", "contour_errors", "contours", "controllers", "errors", "evaluation", "export",
    "feedrate", "identification", "logs", "machines", "papers", "recordings", "reports",
    "scenarios", "simulation", "testing", "typing", "units",
)  # fmt: skip
_NAMES = {
    "Comparison": "contourlab.simulation",
    "Recording": "contourlab.recordings",
    "compare": "contourlab.simulation",
    "estimate_accuracy": "contourlab.contour_errors",
    "evaluate": "contourlab.evaluation",
    "replace": "contourlab.configuration",
    "reproduce": "contourlab.papers",
    "simulate": "contourlab.simulation",
    "simulate_many": "contourlab.simulation",
}

__all__ = [*_PACKAGES, *_NAMES, "__version__"]


def _use_float64() -> None:
    jax = sys.modules.get("jax")
    if jax is not None:
        jax.config.update("jax_enable_x64", True)
    else:
        os.environ["JAX_ENABLE_X64"] = "1"  # read when JAX is imported, which may be never


def _compile_small_loops_whole() -> None:
    # XLA runs a loop operation by operation, some 0.1 us each, unless its body touches less memory
    # than this; a closed loop of a few axes touches a few kB, a batch of machines far more
    flags, option = os.environ.get("XLA_FLAGS", ""), "xla_cpu_small_while_loop_byte_threshold"
    if "xla_backend_extra_options" not in flags:
        addition = f"--xla_backend_extra_options={option}=32768"
        os.environ["XLA_FLAGS"] = f"{flags} {addition}".strip()


_use_float64()
_compile_small_loops_whole()

if TYPE_CHECKING:
    from contourlab import (
        configuration,
        contour_errors,
        contours,
        controllers,
        errors,
        evaluation,
        export,
        feedrate,
        identification,
        logs,
        machines,
        papers,
        recordings,
        reports,
        scenarios,
        simulation,
        testing,
        typing,
        units,
    )
    from contourlab.configuration import replace
    from contourlab.contour_errors import estimate_accuracy
    from contourlab.evaluation import evaluate
    from contourlab.papers import reproduce
    from contourlab.recordings import Recording
    from contourlab.simulation import Comparison, compare, simulate, simulate_many


def __getattr__(name: str) -> Any:
    if name in _PACKAGES:
        return importlib.import_module(f"contourlab.{name}")
    if name in _NAMES:
        return getattr(importlib.import_module(_NAMES[name]), name)
    raise AttributeError(f"module 'contourlab' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
