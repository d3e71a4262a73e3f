"""Several controllers on the same part, on one machine or several."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from contourlab.controllers.base import Controller
from contourlab.errors import ContourlabError, RefusedError, SimulationError, choices
from contourlab.feedrate import Plan
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.corners import (
    CORNER_RADIUS,
    CornerPass,
    find_corners,
    measure_corners,
)
from contourlab.recordings.metrics import MetricValue
from contourlab.recordings.recording import Recording
from contourlab.recordings.reference import Reference
from contourlab.simulation.blended_corners import blended_corners
from contourlab.simulation.checks import as_reference, check_seed
from contourlab.simulation.draws import Listed, Variation
from contourlab.simulation.engines import Engine, find_engine
from contourlab.simulation.pairing import (
    ONLY,
    Controllers,
    Loop,
    Refusal,
    named_controllers,
    pair_loops,
)
from contourlab.simulation.run import simulate
from contourlab.simulation.spread import Spread, check_variable, run_spread

if TYPE_CHECKING:
    import pandas as pd

    from contourlab.contours.part import Part

__all__ = ["Comparison", "compare"]


@dataclass(frozen=True)
class Comparison:
    """The recordings of several controllers on the same part, in the order given.

    On one machine, ``recordings`` is by name of the controller. On several, its keys are such as
    ``"cascade on mill"``; ``runs`` is by machine and controller.
    """

    recordings: Mapping[str, Recording]
    reference: Reference
    """Of the first machine; of all of them unless each was planned by its own limits."""
    machine: Machine
    """The first machine."""
    part: Part | None = None
    """Where the contour came from, if it came from a part program: source lines and text."""
    stops: tuple[float, ...] = ()
    """Times of exact stops [s], where the reference waits at a corner."""
    scenario: str = ""
    """Text of the scenario file that made it, if there was one."""
    title: str = ""
    machines: Mapping[str, Machine] = field(default_factory=dict)
    """By name; empty if there is one without a name."""
    references: Mapping[str, Reference] = field(default_factory=dict)
    """By machine, if they differ."""
    pairs: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """Machine and controller of each of ``rows``."""
    spread: Mapping[str, Spread] = field(default_factory=dict)
    """The metrics under variation, by the keys of ``recordings``; empty if nothing varied."""
    variation: Variation | None = None
    """What varied."""
    corner_radius: float = CORNER_RADIUS
    """Length of path on either side of a corner that is judged with it [m]."""
    notes: tuple[tuple[str, str], ...] = ()
    """What else the report should say of how it was made, by name."""
    plans: Mapping[str, Plan] = field(default_factory=dict)
    """How the feed was planned, by machine if the references differ; empty if it was not."""
    refusals: Mapping[str, Refusal] = field(default_factory=dict)
    """Laws that have no recording on a machine, and why; by what their runs would be called."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the runs: of the controllers if there is one machine."""
        return tuple(self.recordings)

    @property
    def rows(self) -> tuple[str, ...]:
        """All that was asked for, in the order given: the runs, and what was refused or failed."""
        return tuple(dict.fromkeys((*self.pairs, *self.recordings, *self.refusals)))

    @property
    def runs(self) -> dict[tuple[str, str], Recording]:
        """The recordings by machine and controller."""
        return {self.pair(name): recording for name, recording in self.recordings.items()}

    def status(self, name: str) -> str:
        """Return how it went: ``normal``, where a run diverged, or why there is none.

        Parameters
        ----------
        name
            One of ``rows``.
        """
        if name in self.refusals:
            return self.refusals[name].status
        return self.recordings[name].status

    @property
    def several(self) -> bool:
        """Whether there are several machines."""
        return len(self.machines) > 1

    def pair(self, name: str) -> tuple[str, str]:
        """Return machine and controller of a run.

        Parameters
        ----------
        name
            One of ``rows``.
        """
        return self.pairs.get(name, (next(iter(self.machines), ONLY), name))

    def machine_of(self, name: str) -> Machine:
        """Return the machine of a run.

        Parameters
        ----------
        name
            One of ``names``.
        """
        return self.machines.get(self.pair(name)[0], self.machine)

    def reference_of(self, name: str) -> Reference:
        """Return what was asked of the axes in a run.

        Parameters
        ----------
        name
            One of ``names``.
        """
        return self.references.get(self.pair(name)[0], self.reference)

    @property
    def reference_warnings(self) -> dict[str, tuple[str, ...]]:
        """Warnings of each reference, by machine if they differ, else under ``""``.

        Of how it moves only where a run follows it.
        """
        said = {sentence for one in self.recordings.values() for sentence in one.warnings}
        return {
            name: tuple(
                sentence
                for sentence in reference.warnings
                if sentence not in reference.motion_warnings or sentence in said
            )
            for name, reference in (self.references or {"": self.reference}).items()
        }

    @functools.cached_property
    def corners(self) -> dict[str, tuple[CornerPass, ...]]:
        """How each run takes the corners of the path, by run; empty if the path has none."""
        contour = self.reference.contour
        plan = next(iter(self.plans.values()), None)
        corners = tuple(
            sorted(
                (
                    *find_corners(contour, radius=self.corner_radius),
                    *blended_corners(plan, self.part, self.corner_radius),
                ),
                key=lambda corner: corner.parameter,
            )
        )
        if not corners:
            return {}
        start, end = (float(bound) for bound in contour.domain)
        period = end - start if contour.closed else None
        needed = {"tool", "contour_error_vector", "foot_parameter", "reference_parameter"}
        found = {
            name: measure_corners(recording, corners, period=period)
            for name, recording in self.recordings.items()
            if needed <= set(map(str, recording.dataset.variables))
        }
        return found if any(found.values()) else {}

    def metric(self, name: str) -> dict[str, MetricValue]:
        """Return one metric of every run, by name of the run.

        Parameters
        ----------
        name
            As in ``recordings.METRICS``.
        """
        return {who: recording.metrics[name] for who, recording in self.recordings.items()}

    def best(self, name: str) -> str | None:
        """Return the run with the least value of a metric, None if all diverged.

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
        """Return all metrics in SI: a row per run; a vector metric has a column per axis.

        With several machines the index is machine and controller. A law that was refused or failed
        has no figures (NaN), and its status says why.
        """
        import pandas as pd

        rows: dict[Any, dict[str, Any]] = {}
        for who in self.rows:
            row: dict[str, Any] = {}
            metrics = self.recordings[who].metrics if who in self.recordings else {}
            for name, value in metrics.items():
                if isinstance(value, list):
                    for axis, single in zip(self.machine_of(who).names, value, strict=True):
                        row[f"{name}_{axis}"] = single
                else:
                    row[name] = value
            row["status"] = self.status(who)
            rows[self.pair(who) if self.several else who] = row
        table = pd.DataFrame.from_dict(rows, orient="index")
        if self.several:
            table.index = pd.MultiIndex.from_tuples(rows, names=["machine", "controller"])
        return table


def compare(
    machine: Machine | Mapping[str, Machine],
    controllers: Controllers | Sequence[Controller],
    reference: Reference | Plan | Mapping[str, Reference | Plan],
    *,
    disturbances: Sequence[Disturbance] | Disturbance = (),
    seed: int = 0,
    vary: Variation | Mapping[str, Any] | None = None,
    part: Part | None = None,
    stops: Sequence[float] = (),
    scenario: str = "",
    title: str = "",
    corner_radius: float = CORNER_RADIUS,
    notes: Sequence[tuple[str, str]] = (),
    progress: Callable[[str, float], None] | None = None,
    engine: str | Engine = "jax",
) -> Comparison:
    """Run every controller on the same part, on one machine or on each of several.

    All controllers are checked and bound on all machines before the first one runs, so that a
    mistake shows at once. A run that diverges ends early and says so; the others go on. So do they
    where a controller is refused, because a machine or the contour is not what it is for, or fails:
    it is among ``refusals`` then.

    Parameters
    ----------
    machine
        One, or several by name.
    controllers
        By name, or a sequence; then each is called by its class in snake case, numbered if there
        are several of one class. In place of a controller, a mapping from names of machines to
        controllers: its gains may differ from machine to machine, and it runs on these only; or the
        ``RefusedError`` that making it ended in, which its row then says.
    reference
        As for ``simulate``: one for all machines, or one for each by name (then times and errors
        are of different motions).
    disturbances, seed
        As for ``simulate``.
    vary
        Values that vary, beside the run as it stands: every controller meets the same samples. A
        :class:`Variation`, or values by path as for ``simulate_many``, zipped.
    part
        Where the contour came from, for the report.
    stops
        Times of exact stops [s], for the report; those of the plan if one is given.
    scenario, title
        For the report.
    corner_radius
        Length of path on either side of a corner that is judged with it, > 0 [m].
    notes
        What else the report should say of how it was made: pairs of name and text.
    progress
        Called with the run's name and the fraction of it done.
    engine
        What computes the runs, as for ``simulate``. What varies runs as one batch, in JAX.

    Returns
    -------
    Comparison
        The recordings in the order given, machine after machine.

    Raises
    ------
    RefusedError, TravelError, GeometryError
        No controller can run on any machine; says why the first cannot.
    SimulationError, ConfigurationError
        Nothing to run, an unknown engine, unknown names, values that are out of bounds wherever the
        law runs, values to vary that do not exist or are out of bounds.
    """
    engine = find_engine(engine)
    check_seed(seed)
    named = isinstance(machine, Mapping)
    machines = dict(machine) if isinstance(machine, Mapping) else {ONLY: machine}
    by_machine = isinstance(reference, Mapping)
    plans = _plans(reference, next(iter(machines), ONLY))
    references, stops = _references(reference, machines, stops)
    controllers = named_controllers(controllers)
    rows = pair_loops(machines, controllers, references, disturbances)
    loops = {label: row for label, row in rows.items() if isinstance(row, Loop)}
    refusals = {label: row for label, row in rows.items() if isinstance(row, Refusal)}
    find_corners(next(iter(references.values())).contour, radius=corner_radius)  # or say why not
    variation = _variation(vary)
    lanes = {}
    if variation is not None:
        for label, loop in loops.items():
            lanes[label] = variation.lanes(
                loop.parts, machine=loop.machine_name, controller=loop.controller_name,
                machines=tuple(machines), controllers=tuple(controllers), seed=seed,
            )  # fmt: skip
            check_variable(loop.controller, lanes[label])

    def told(name: str) -> Callable[[float], None] | None:
        return None if progress is None else lambda done: progress(name, done)

    recordings: dict[str, Recording] = {}
    for label, loop in loops.items():
        try:
            recordings[label] = simulate(
                loop.machine, loop.controller, loop.reference, disturbances=loop.disturbances,
                seed=seed, name=loop.controller_name, scenario=scenario, progress=told(label),
                engine=engine,
            )  # fmt: skip
        except ContourlabError as error:
            refusals[label] = Refusal(
                loop.machine_name, loop.controller_name, str(error),
                failed=not isinstance(error, RefusedError),
            )  # fmt: skip
    if not recordings:
        label = next(label for label in loops if label in refusals)
        raise RefusedError(f"no controller could be run; {label} {refusals[label].status}")
    spread = {
        label: run_spread(
            loop.machine, loop.controller, loop.reference, lanes[label],
            disturbances=loop.disturbances,
            progress=told(f"{label}, {variation.n_samples} samples"),
        )
        for label, loop in loops.items()
        if variation is not None and label in recordings
    }  # fmt: skip
    first = next(iter(machines))
    return Comparison(
        recordings, references[first], machines[first], part, tuple(stops), scenario, title,
        machines=machines if named else {}, references=references if by_machine else {},
        pairs={label: (row.machine_name, row.controller_name) for label, row in rows.items()},
        spread=spread, variation=variation, corner_radius=corner_radius, notes=tuple(notes),
        plans=plans, refusals={label: refusals[label] for label in rows if label in refusals},
    )  # fmt: skip


def _plans(given: Reference | Plan | Mapping[str, Reference | Plan], first: str) -> dict[str, Plan]:
    by_machine = dict(given) if isinstance(given, Mapping) else {first: given}
    return {name: plan for name, plan in by_machine.items() if isinstance(plan, Plan)}


def _references(
    given: Reference | Plan | Mapping[str, Reference | Plan], machines: Mapping[str, Machine],
    stops: Sequence[float],
) -> tuple[dict[str, Reference], Sequence[float]]:  # fmt: skip
    if not machines:
        raise SimulationError("compare needs one machine or more")
    plans = dict(given) if isinstance(given, Mapping) else dict.fromkeys(machines, given)
    for name in machines:
        if name not in plans:
            raise SimulationError(f"machine {name} has no reference")
    for name in plans:
        if name not in machines:
            raise SimulationError(f"a reference for {name!r}; {choices(name, machines)}")
    first = plans[next(iter(machines))]
    if isinstance(first, Plan) and not stops:
        stops = tuple(float(t) for t in first.stop_times)
    return {name: as_reference(plans[name]) for name in machines}, stops


def _variation(vary: Variation | Mapping[str, Any] | None) -> Variation | None:
    if vary is None or isinstance(vary, Variation):
        return vary
    return Variation(changes={path: Listed(values_of=values) for path, values in vary.items()})
