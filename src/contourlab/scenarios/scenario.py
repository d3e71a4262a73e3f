"""A scenario as objects, ready to run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from contourlab.contours.part import Part
from contourlab.controllers.base import Controller
from contourlab.errors import RefusedError, ScenarioError
from contourlab.feedrate import Plan
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.corners import CORNER_RADIUS
from contourlab.recordings.reference import Reference
from contourlab.simulation.comparison import Comparison, compare
from contourlab.simulation.draws import Variation
from contourlab.simulation.pairing import run_label

__all__ = ["Scenario", "Setup"]


@dataclass(frozen=True)
class Setup:
    """What runs on one machine of a scenario."""

    machine: Machine
    controllers: Mapping[str, Controller]
    """By name; their gains are of this machine's nominal model."""
    motion: Plan | Reference
    """The planned feed, or the reference where nothing was planned."""
    refused: Mapping[str, ScenarioError] = field(default_factory=dict)
    """Why other controllers do not run on this machine, by name; says where they stand."""

    @property
    def reference(self) -> Reference:
        """What is asked of the axes."""
        return self.motion.reference if isinstance(self.motion, Plan) else self.motion

    @property
    def stops(self) -> tuple[float, ...]:
        """Times of exact stops [s]."""
        if not isinstance(self.motion, Plan):
            return ()
        return tuple(float(time) for time in self.motion.stop_times)


@dataclass(frozen=True)
class Scenario:
    """A scenario as objects: everything that a run or a comparison needs."""

    setups: Mapping[str, Setup]
    """By name of the machine; one or more."""
    disturbances: tuple[Disturbance, ...]
    seed: int
    part: Part | None
    """The part program, if the contour came from one."""
    title: str
    magnification: float | None
    text: str
    """The file's text."""
    source: str
    """Its name as given."""
    variation: Variation | None = None
    """What varies beside the run as it stands."""
    corner_radius: float = CORNER_RADIUS
    """Length of path on either side of a corner that is judged with it [m]."""
    notes: tuple[tuple[str, str], ...] = ()
    """What else the report says of how it was made."""
    common: bool = True
    """Whether all machines have the same reference."""
    engine: str = "jax"
    """What computes the runs."""
    names: tuple[str, ...] = ()
    """Of all controllers, in the order of the file."""

    @property
    def machine(self) -> Machine:
        """The first machine."""
        return self._first.machine

    @property
    def controllers(self) -> Mapping[str, Controller]:
        """The controllers of the first machine, by name."""
        return self._first.controllers

    @property
    def reference(self) -> Reference:
        """What is asked of the axes of the first machine."""
        return self._first.reference

    @property
    def stops(self) -> tuple[float, ...]:
        """Times of exact stops on the first machine [s]."""
        return self._first.stops

    @property
    def planned(self) -> bool:
        """Whether the feed was planned, on any machine."""
        return any(isinstance(setup.motion, Plan) for setup in self.setups.values())

    @property
    def _first(self) -> Setup:
        return next(iter(self.setups.values()))

    @property
    def runs(self) -> tuple[str, ...]:
        """What the runs of :meth:`compare` will be called, in their order; none is refused."""
        several = len(self.setups) > 1
        return tuple(
            run_label(where, name) if several else name
            for where, setup in self.setups.items()
            for name in setup.controllers
        )

    def compare(self, progress: Any = None, engine: str | None = None) -> Comparison:
        """Run every controller of the scenario on every machine that takes it.

        Parameters
        ----------
        progress
            As for :func:`contourlab.compare`.
        engine
            In place of the scenario's own.
        """
        controllers: dict[str, dict[str, Controller | RefusedError]] = {
            name: {} for name in self.names
        }
        for where, setup in self.setups.items():
            for name, error in setup.refused.items():
                controllers[name][where] = RefusedError(error.message)
            for name, controller in setup.controllers.items():
                controllers[name][where] = controller
        motions = {where: setup.motion for where, setup in self.setups.items()}
        return compare(
            {where: setup.machine for where, setup in self.setups.items()}, controllers,
            self._first.motion if self.common else motions,
            disturbances=self.disturbances, seed=self.seed, vary=self.variation, part=self.part,
            stops=self.stops, scenario=self.text, title=self.title,
            corner_radius=self.corner_radius, notes=self.notes, progress=progress,
            engine=engine or self.engine,
        )  # fmt: skip
