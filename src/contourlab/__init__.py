"""Contouring control: designed, judged by the exact contour error, and shipped to real time.

``import contourlab`` makes JAX compute in float64 (``jax_enable_x64``), for the whole process: a
contour error of a micrometre on a metre is lost in float32. Packages are imported when first used.
"""

from __future__ import annotations

import importlib
import os
import sys
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_PACKAGES = (
    "configuration", "contour_errors", "contours", "controllers", "errors", "feedrate", "machines",
    "recordings", "reports", "scenarios", "simulation", "testing", "typing", "units",
)  # fmt: skip
_NAMES = {
    "Comparison": "contourlab.simulation",
    "Recording": "contourlab.recordings",
    "compare": "contourlab.simulation",
    "replace": "contourlab.configuration",
    "simulate": "contourlab.simulation",
    "simulate_many": "contourlab.simulation",
}

__all__ = [*_PACKAGES, *_NAMES, "__version__"]  # noqa: PLE0604  (all strings)


def _use_float64() -> None:
    jax = sys.modules.get("jax")
    if jax is not None:
        jax.config.update("jax_enable_x64", True)
    else:
        os.environ["JAX_ENABLE_X64"] = "1"  # read when JAX is imported, which may be never


_use_float64()

if TYPE_CHECKING:
    from contourlab import (
        configuration,
        contour_errors,
        contours,
        controllers,
        errors,
        feedrate,
        machines,
        recordings,
        reports,
        scenarios,
        simulation,
        testing,
        typing,
        units,
    )
    from contourlab.configuration import replace
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
