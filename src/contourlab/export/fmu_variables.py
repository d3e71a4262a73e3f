"""The variables of a functional mock-up unit: one for each number of the exported law."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator

import numpy as np

from contourlab.export.fields import Field
from contourlab.export.generate import GeneratedC

__all__ = ["Range", "Variable", "ranges_of", "variables_of"]

SETTABLE, WHOLE = 1, 2


@dataclasses.dataclass(frozen=True)
class Range:
    """The value references of one field, which lie one after another in memory."""

    first: int
    field: Field
    group: str
    """``inputs``, ``outputs`` or ``parameters``."""

    @property
    def name(self) -> str:
        """Name of the field in C."""
        return self.field.name

    @property
    def count(self) -> int:
        """Number of numbers."""
        return self.field.size

    @property
    def flags(self) -> int:
        """Whether it may be set, and whether it is whole."""
        settable = 0 if self.group == "outputs" else SETTABLE
        return settable | (0 if self.field.dtype == "real" else WHOLE)


@dataclasses.dataclass(frozen=True)
class Variable:
    """One number, as the model description shows it."""

    reference: int
    name: str
    group: str
    whole: bool
    unit: str
    start: str
    description: str


def ranges_of(generated: GeneratedC) -> tuple[Range, ...]:
    """Return where each value reference lies: inputs, outputs, then parameters, from 1.

    Time, if the law reads it, is not an input of the unit: it is that of the simulation.

    Parameters
    ----------
    generated
        The exported law.
    """
    found, first = [], 1
    for group in ("inputs", "outputs", "parameters"):
        for field in getattr(generated, group):
            if group == "inputs" and field.path == "time":
                continue
            found.append(Range(first, field, group))
            first += field.size
    return tuple(found)


def variables_of(generated: GeneratedC, ranges: tuple[Range, ...]) -> Iterator[Variable]:
    """Yield every variable but time.

    Names are those of the exported structures with indices from 1; parameters stand under
    ``parameters.`` and what a law shows of itself under ``telemetry.``, so that no two names meet.

    Parameters
    ----------
    generated
        The exported law.
    ranges
        As :func:`ranges_of` gave them.
    """
    for span in ranges:
        field = span.field
        root = field.name
        if span.group == "parameters":
            root = f"parameters.{root}"
        elif span.group == "outputs" and field.name not in ("command", "status", "finished"):
            root = f"telemetry.{root}"
        starts = np.zeros(field.size)
        if span.group == "parameters":
            starts = np.asarray(generated.defaults[field.name], float).ravel()
        indices = itertools.product(*(range(1, n + 1) for n in field.shape))
        for k, index in enumerate(indices):
            suffix = f"[{','.join(map(str, index))}]" if index else ""
            whole = field.dtype != "real"
            yield Variable(
                reference=span.first + k,
                name=f"{root}{suffix}",
                group=span.group,
                whole=whole,
                unit=field.unit,
                start=_start(starts[k], whole),
                description=f"{field.path}: {field.text}" if field.text else field.path,
            )


def _start(value: float, whole: bool) -> str:
    """Return a start value as XML Schema writes it."""
    if whole:
        return str(int(value))
    if np.isnan(value):
        return "NaN"
    if np.isinf(value):
        return "INF" if value > 0.0 else "-INF"
    return f"{value:.17g}"
