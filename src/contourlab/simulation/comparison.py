"""Several controllers on the same part and machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from contourlab.controllers.base import Controller
from contourlab.errors import SimulationError
from contourlab.feedrate import Plan
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.metrics import MetricValue
from contourlab.recordings.recording import Recording
from contourlab.recordings.reference import Reference
from contourlab.simulation.checks import as_disturbances, as_reference, check_loop, snake_case
from contourlab.simulation.run import simulate

if TYPE_CHECKING:
    import pandas as pd

    from contourlab.contours.part import Part

__all__ = ["Comparison", "compare"]


@dataclass(frozen=True)
class Comparison:
    """The recordings of several controllers on the same part and machine, in the order given."""

    recordings: Mapping[str, Recording]
    reference: Reference
    machine: Machine
    part: Part | None = None
    """Where the contour came from, if it came from a part program: source lines and text."""
    stops: tuple[float, ...] = ()
    """Times of exact stops [s], where the reference waits at a corner."""
    scenario: str = ""
    """Text of the scenario file that made it, if there was one."""
    title: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the controllers."""
        return tuple(self.recordings)

    def metric(self, name: str) -> dict[str, MetricValue]:
        """Return one metric of every controller, by name of the controller.

        Parameters
        ----------
        name
            As in ``recordings.METRICS``.
        """
        return {who: recording.metrics[name] for who, recording in self.recordings.items()}

    def best(self, name: str) -> str | None:
        """Return the controller with the least value of a metric, None if all diverged.

        Parameters
        ----------
        name
            A scalar metric.
        """
        values = {
            who: value
            for who, value in self.metric(name).items()
            if isinstance(value, float) and math.isfinite(value)
        }
        return min(values, key=values.__getitem__) if values else None

    def table(self) -> pd.DataFrame:
        """Return all metrics in SI: a row per controller; a vector metric has a column per axis."""
        import pandas as pd

        rows: dict[str, dict[str, Any]] = {}
        for who, recording in self.recordings.items():
            row: dict[str, Any] = {}
            for name, value in recording.metrics.items():
                if isinstance(value, list):
                    for axis, single in zip(self.machine.names, value, strict=True):
                        row[f"{name}_{axis}"] = single
                else:
                    row[name] = value
            row["status"] = recording.status
            rows[who] = row
        return pd.DataFrame.from_dict(rows, orient="index")


def compare(
    machine: Machine,
    controllers: Mapping[str, Controller] | Sequence[Controller],
    reference: Reference | Plan,
    *,
    disturbances: Sequence[Disturbance] | Disturbance = (),
    seed: int = 0,
    part: Part | None = None,
    stops: Sequence[float] = (),
    scenario: str = "",
    title: str = "",
    progress: Callable[[str, float], None] | None = None,
) -> Comparison:
    """Run every controller on the same part and machine.

    All controllers are checked and bound before the first one runs, so that a mistake shows at
    once. A run that diverges ends early and says so; the others go on.

    Parameters
    ----------
    machine, reference, disturbances, seed
        As for ``simulate``.
    controllers
        By name, or a sequence; then each is called by its class in snake case, numbered if there
        are several of one class.
    part
        Where the contour came from, for the report.
    stops
        Times of exact stops [s], for the report; those of the plan if one is given.
    scenario, title
        For the report.
    progress
        Called with the controller's name and the fraction of its run done.

    Returns
    -------
    Comparison
        The recordings by name, in the order given.

    Raises
    ------
    RefusedError, TravelError
        A controller cannot take the contour or the machine; the part leaves the travel.
    """
    if isinstance(reference, Plan) and not stops:
        stops = tuple(float(t) for t in reference.stop_times)
    reference = as_reference(reference)
    disturbances = as_disturbances(disturbances, machine)
    if not isinstance(controllers, Mapping):
        controllers = _named(controllers)
    if not controllers:
        raise SimulationError("compare needs one controller or more")
    for controller in controllers.values():
        check_loop(machine, controller, reference)
        controller.bind(reference.contour, reference.sample_time)
    recordings = {}

    def told(name: str) -> Callable[[float], None] | None:
        return None if progress is None else lambda done: progress(name, done)

    for name, controller in controllers.items():
        recordings[name] = simulate(
            machine, controller, reference, disturbances=disturbances, seed=seed, name=name,
            scenario=scenario,
            progress=told(name),
        )  # fmt: skip
    return Comparison(recordings, reference, machine, part, tuple(stops), scenario, title)


def _named(controllers: Sequence[Controller]) -> dict[str, Controller]:
    kinds = [snake_case(type(controller).__name__) for controller in controllers]
    named = {}
    for k, (kind, controller) in enumerate(zip(kinds, controllers, strict=True)):
        name = kind if kinds.count(kind) == 1 else f"{kind}_{kinds[: k + 1].count(kind)}"
        named[name] = controller
    return named
