"""What made a comparison: scenario, machine, controllers, versions, seed, sample time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from contourlab.reports.spread_table import change_words

if TYPE_CHECKING:
    from contourlab.simulation.comparison import Comparison

__all__ = ["Provenance", "provenance"]

_KNOWN = frozenset({
    "configuration", "contour", "contourlab", "controller", "controller_class", "disturbances",
    "diverged_at", "diverged_axis", "machine", "outcome", "sample_time", "seed", "warnings",
})  # fmt: skip


@dataclass(frozen=True)
class Provenance:
    """What made a comparison, as text."""

    facts: tuple[tuple[str, str], ...]
    """Short ones, by name."""
    assumed: tuple[str, ...]
    """What stands in the machine without a measurement or a source, in sentences."""
    scenario: str
    machines: tuple[tuple[str, str], ...]
    """Configuration by name; the name is empty if there is one machine."""
    controllers: tuple[tuple[str, str], ...]
    """Configuration by name."""


def provenance(comparison: Comparison) -> Provenance:
    """Return what made a comparison.

    Parameters
    ----------
    comparison
        With one recording or more.
    """
    import contourlab

    recordings = comparison.recordings
    reference = comparison.reference
    sample_time = float(np.asarray(reference.sample_time))
    facts = [
        ("contourlab", _common(comparison, "contourlab") or "unknown"),
        ("report written by", f"contourlab {contourlab.__version__}, {_plotly()}"),
        ("sample time", f"{sample_time * 1e3:.6g} ms ({1.0 / sample_time:.6g} Hz)"),
        ("samples of the reference", f"{reference.n_samples} ({reference.duration:.6g} s)"),
        ("seed", _common(comparison, "seed")),
        ("contour", _common(comparison, "contour") or type(reference.contour).__name__),
        ("disturbances", "none" if _common(comparison, "disturbances") in ("", "()") else
         _common(comparison, "disturbances")),
    ]  # fmt: skip
    if comparison.part is not None:
        facts.insert(0, ("part", f"{comparison.part.source}, {comparison.part.n_pieces} pieces"))
    facts += comparison.notes
    if comparison.variation is not None:
        variation = comparison.variation
        facts.append(("samples", f"{variation.n_samples}, the same ones for every controller; "
                      f"seed {variation.seed}"))  # fmt: skip
        facts += [(path, change_words(change)) for path, change in variation.changes.items()]
    others = {key for r in recordings.values() for key in r.dataset.attrs} - _KNOWN
    facts += [(str(key), _common(comparison, key)) for key in sorted(others, key=str)]
    assumed: list[str] = []
    for machine in comparison.machines.values() or (comparison.machine,):
        own = getattr(machine, "assumed", ())
        assumed += [own] if isinstance(own, str) else [str(a) for a in own]
    machines = dict.fromkeys(comparison.pair(name)[0] for name in recordings)
    configured = {
        machine: next(
            str(r.dataset.attrs.get("machine", ""))
            for name, r in recordings.items()
            if comparison.pair(name)[0] == machine
        )
        for machine in machines
    }
    return Provenance(
        facts=tuple((name, value) for name, value in facts if value),
        assumed=tuple(dict.fromkeys(assumed)),
        scenario=comparison.scenario,
        machines=tuple(configured.items())
        if comparison.several
        else (("", _common(comparison, "machine")),),
        controllers=tuple(
            (name, str(r.dataset.attrs.get("configuration", ""))) for name, r in recordings.items()
        ),
    )


def _common(comparison: Comparison, key: str) -> str:
    """Return an attribute of the recordings; each one's own where they differ."""
    values = {name: str(r.dataset.attrs.get(key, "")) for name, r in comparison.recordings.items()}
    if len(set(values.values())) == 1:
        return next(iter(values.values()))
    return "; ".join(f"{name}: {value}" for name, value in values.items() if value)


def _plotly() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return f"plotly {version('plotly')}"
    except PackageNotFoundError:
        return "plotly"
