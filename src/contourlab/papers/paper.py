"""What a reproduced paper is, and what a verdict takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from contourlab.reports.reproduction import Reproduction

__all__ = ["MATCH", "Paper", "Progress", "change_percent", "close"]

Progress = Callable[[str, float], None]

MATCH = 0.05
"""Relative difference up to which a figure counts as matched."""


@dataclass(frozen=True)
class Paper:
    """A paper whose experiments can be run."""

    slug: str
    title: str
    figures: tuple[str, ...]
    """Names of the figures that a run gives."""
    run: Callable[[Progress], Reproduction]


def close(reproduced: float, published: float, tolerance: float = MATCH) -> bool:
    """Return whether a figure is the published one within a relative tolerance.

    Parameters
    ----------
    reproduced, published
        The figures.
    tolerance
        Relative to the published one.
    """
    return abs(reproduced - published) <= tolerance * abs(published)


def change_percent(before: float, after: float) -> float:
    """Return by how many percent a figure fell.

    Parameters
    ----------
    before, after
        The figures.
    """
    return 100.0 * (1.0 - after / before)
