"""One cause of a contour error: how large, which share, what would remove it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

__all__ = ["STATES", "Cause"]

STATES = ("found", "small", "not separable", "unobservable", "not tested")
"""``small`` is not told from chance; the last three have no figures."""


@dataclass(frozen=True, eq=False)
class Cause:
    """A cause of the contour error."""

    name: str
    """Such as ``friction X``."""
    kind: str
    """``lag``, ``friction``, ``backlash``, ``scale``, ``squareness``, ``alignment``, ``cyclic``,
    ``vibration``, ``commanded path`` or ``rest``."""
    axes: tuple[str, ...]
    state: str
    """One of :data:`STATES`."""
    rms: float = float("nan")
    """Of the contour error that it makes [m]."""
    max: float = float("nan")
    """Largest contour error that it makes alone [m]."""
    share: float = float("nan")
    """Of the mean square of the contour error: the mean of its own contour error times the whole,
    over the mean square of the whole. All shares add up to one; one that is negative works against
    the others."""
    parameters: dict[str, tuple[float, str]] = field(default_factory=dict)
    """Value and unit (SI) by name."""
    remedy: str = ""
    """What would remove it."""
    note: str = ""
    """Why it has no figures, or with what it may be mistaken."""
    signal: Float[np.ndarray, " n_samples"] | None = field(default=None, repr=False)
    """The contour error that it makes at every sample [m]; NaN where none is judged."""

    def json(self) -> dict[str, Any]:
        """Return the cause for JSON: SI, None for what is not known."""

        def finite(value: float) -> float | None:
            return float(value) if np.isfinite(value) else None

        return {
            "name": self.name, "kind": self.kind, "axes": list(self.axes), "state": self.state,
            "rms": finite(self.rms), "max": finite(self.max), "share": finite(self.share),
            "parameters": {
                key: {"value": finite(value), "unit": unit}
                for key, (value, unit) in self.parameters.items()
            },
            "remedy": self.remedy, "note": self.note,
        }  # fmt: skip
