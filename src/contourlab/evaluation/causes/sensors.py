"""Which causes a sensor can see, by where it measures.

A motor's encoder sees what the motor does: what lies between motor and tool is not in its signal. A
scale on the table sees the screw and the lost motion, not its own errors nor the angle between the
axes. An instrument at the tool, a grid encoder or a ball bar, sees all.
"""

from __future__ import annotations

from contourlab.errors import ConfigurationError, choices

__all__ = ["SIDES", "check_side", "refusal", "sees"]

SIDES = ("motor", "scale", "tool")
_UNSEEN = {
    "motor": ("backlash", "scale", "squareness", "cyclic"),
    "scale": ("squareness",),
    "tool": (),
}
_WHY = {
    "motor": "the position was measured on the motor, and this lies between motor and tool",
    "scale": "the position was measured by a scale on each axis, which does not see the angle "
    "between axes",
}


def check_side(measured: str | None) -> None:
    """Raise ConfigurationError unless a side is known.

    Parameters
    ----------
    measured
        As the user wrote it; None if it is not stated.
    """
    if measured is not None and measured not in SIDES:
        raise ConfigurationError(f"unknown measured {measured!r}; {choices(measured, SIDES)}")


def sees(kind: str, measured: str | None) -> bool:
    """Return whether a cause can be in the signal; if nothing is stated, it can.

    Parameters
    ----------
    kind
        Of the cause.
    measured
        Where the position was measured.
    """
    return measured is None or kind not in _UNSEEN[measured]


def refusal(kind: str, measured: str) -> str:
    """Return why a cause cannot be seen.

    Parameters
    ----------
    kind
        Of the cause.
    measured
        Where the position was measured.
    """
    del kind
    return _WHY[measured]
