"""What is drawn, for the page and for the figures alike: a comparison as arrays ready to plot.

Nothing here is a new result: errors, foot points and metrics are the recordings' own. What is added
is where a sample lies on the part (source line, distance along the path), how far a diverged run is
shown, and the factor by which deviations are magnified.

The magnified path of a controller is ``foot - factor * vector``: the contour error vector runs from
the actual tool point to its foot point, so a factor of 1 gives the actual path.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int

from contourlab.errors import ConfigurationError, RecordingError
from contourlab.reports.decimation import shape_rows
from contourlab.reports.palette import Look, look

if TYPE_CHECKING:
    from contourlab.contours.base import Contour
    from contourlab.recordings.metrics import MetricValue
    from contourlab.recordings.recording import Recording
    from contourlab.simulation.comparison import Comparison

__all__ = ["Drawing", "Run", "Stops", "contour_points", "make_drawing"]

PATH_POINTS = 20_000
_BATCHES = (1024, 8192)
LARGEST_DEVIATION = 1.0 / 15.0
"""Share of the part that the largest deviation takes by default."""
FAR_WORSE = 10.0
"""A run with more than this many times the largest error of the best leaves the picture, which
would otherwise show nothing of the others."""
DIVERGED_SHOWN = 2.0
"""A diverged run is shown until its error is this many times the largest in the picture."""
LINE_TEXT = 90
LABELS = 4


@dataclass(frozen=True, eq=False)
class Run:
    """One controller's record, cut where a diverged run leaves the picture; SI."""

    name: str
    """Of the controller; with the machine's if there are several."""
    machine: str
    controller: str
    look: Look
    recording: Recording
    metrics: dict[str, MetricValue]
    time: Float[np.ndarray, " n"]
    distance: Float[np.ndarray, " n"]
    """Of the foot point along the path [m]."""
    error: Float[np.ndarray, " n"]
    """Contour error [m]; signed in the plane."""
    foot: Float[np.ndarray, "n n_coordinates"]
    vector: Float[np.ndarray, "n n_coordinates"]
    """From the actual point to the foot point [m]."""
    line: Int[np.ndarray, " n"]
    """Source line of the foot point, 0 if unknown."""
    worst: int | None
    """Row of the largest contour error; None if the run diverged."""

    @property
    def diverged(self) -> bool:
        """Whether the run was stopped because it diverged."""
        return self.recording.diverged

    @property
    def status(self) -> str:
        """``normal``, or in a few words what went wrong."""
        return self.recording.status

    @property
    def largest(self) -> float:
        """Largest contour error in the picture [m]."""
        return float(np.max(np.nan_to_num(np.abs(self.error))))

    def drawn(self, factor: float) -> Float[np.ndarray, "n n_coordinates"]:
        """Return the actual path with its deviation magnified [m].

        Parameters
        ----------
        factor
            1 is true scale.
        """
        return self.foot - factor * self.vector


@dataclass(frozen=True, eq=False)
class Stops:
    """Exact stops: where the reference waits at a corner."""

    time: Float[np.ndarray, " n"]
    distance: Float[np.ndarray, " n"]
    position: Float[np.ndarray, "n n_coordinates"]
    line: Int[np.ndarray, " n"]


@dataclass(frozen=True, eq=False)
class Drawing:
    """A comparison as arrays ready to plot; SI."""

    comparison: Comparison
    runs: tuple[Run, ...]
    path: Float[np.ndarray, "n_points n_coordinates"]
    """The part's contour as a fine polyline [m]."""
    stops: Stops
    coordinates: tuple[str, ...]
    signed: bool
    """Whether errors carry the sign of the left normal."""
    magnification: float
    extent: float
    """Longest side of the part's box [m]."""
    distance: Callable[[Any], Any]
    """Distance along the path [m] of contour parameters."""
    parameter: Callable[[Any], Any]
    """The reverse."""

    @property
    def machines(self) -> dict[str, tuple[Run, ...]]:
        """The runs of each machine, by its name."""
        names = dict.fromkeys(run.machine for run in self.runs)
        return {name: tuple(r for r in self.runs if r.machine == name) for name in names}

    @property
    def one_motion(self) -> bool:
        """Whether all runs follow the same reference, so that its times are those of all."""
        return len({id(r) for r in self.comparison.references.values()}) <= 1

    @property
    def good(self) -> tuple[Run, ...]:
        """The runs that did not diverge."""
        return tuple(run for run in self.runs if not run.diverged)

    @property
    def framed(self) -> tuple[Run, ...]:
        """The runs that decide how large the picture is: none far worse than the best."""
        good = self.good or self.runs
        least = min(run.largest for run in good)
        return tuple(run for run in self.runs if run.diverged or run.largest <= FAR_WORSE * least)

    @property
    def labelled(self) -> tuple[Run, ...]:
        """The runs whose worst point has its label: with many, the least and the greatest."""
        good = sorted((run for run in self.framed if not run.diverged), key=lambda r: r.largest)
        return tuple(good) if len(good) <= LABELS else (good[0], good[-1])

    @property
    def worst_first(self) -> tuple[Run, ...]:
        """The runs in the order of drawing, so that the best is on top."""
        return tuple(sorted(self.runs, key=lambda run: (not run.diverged, -run.largest)))

    @property
    def shown(self) -> int:
        """How many coordinates the picture of the path shows: 2 or 3; 1 if there is no picture."""
        return 3 if len(self.coordinates) == 3 else min(len(self.coordinates), 2)

    @property
    def projection(self) -> str:
        """What the picture leaves out, as a sentence; empty if nothing."""
        if len(self.coordinates) <= 3:
            return ""
        named = " and ".join(self.coordinates[:2])
        return f"The path has {len(self.coordinates)} coordinates; only {named} are drawn."

    def line_text(self, line: int) -> str:
        """Return the text of a source line, shortened; empty if it is not known.

        Parameters
        ----------
        line
            Counted from 1; 0 is unknown.
        """
        part = self.comparison.part
        if part is None or not 1 <= line <= len(part.lines):
            return ""
        text = " ".join(str(part.lines[line - 1]).split())
        return text if len(text) <= LINE_TEXT else text[: LINE_TEXT - 1] + "…"

    def where(self, run: Run, row: int, *, text: bool = True) -> str:
        """Return where on the part a sample lies, in words.

        Parameters
        ----------
        run
            A controller's run.
        row
            Its sample.
        text
            Whether the text of the source line is added.
        """
        line = int(run.line[row])
        if not line:
            return f"{run.distance[row] * 1e3:.4g} mm along the path"
        words = self.line_text(line) if text else ""
        return f"line {line}: {words}" if words else f"line {line}"


def make_drawing(comparison: Comparison, magnification: float | None = None) -> Drawing:
    """Return a comparison as arrays ready to plot.

    Parameters
    ----------
    comparison
        With one recording or more.
    magnification
        Factor by which deviations are drawn larger; chosen from the data if None.

    Raises
    ------
    ConfigurationError
        The factor is not a finite number > 0.
    RecordingError
        There is no recording, or one lacks what is drawn.
    """
    if magnification is not None and not (math.isfinite(magnification) and magnification > 0.0):
        raise ConfigurationError(f"magnification must be finite and > 0, got {magnification}")
    if not comparison.recordings:
        raise RecordingError("a report needs one recording or more")
    contour = comparison.reference.contour
    used = np.concatenate(
        [
            np.asarray(reference.parameter)
            for reference in (comparison.reference, *comparison.references.values())
        ]
        + [np.asarray(r["foot_parameter"]) for r in comparison.recordings.values()]
    )
    parameters = _parameters(contour, used[np.isfinite(used)])
    points = contour_points(contour, parameters)
    distance, parameter = _distances(contour, parameters, points)
    extent = float(np.max(np.ptp(points, axis=0))) or 1.0
    reach = _reach(comparison, extent)
    pairs = [comparison.pair(name) for name in comparison.recordings]
    machines, controllers = (list(dict.fromkeys(names)) for names in zip(*pairs, strict=True))
    runs = tuple(
        _run(
            name, pair, recording, look(controllers.index(pair[1]), machines.index(pair[0])),
            contour, distance, reach,
        )
        for pair, (name, recording) in zip(pairs, comparison.recordings.items(), strict=True)
    )  # fmt: skip
    first = next(iter(comparison.recordings.values()))
    return Drawing(
        comparison=comparison,
        runs=runs,
        path=points[shape_rows(points, PATH_POINTS)],
        stops=_stops(comparison, distance),
        coordinates=tuple(str(name) for name in np.asarray(first["coordinate"])),
        signed=len(points[0]) == 2,
        magnification=_default_factor(runs, extent) if magnification is None else magnification,
        extent=extent,
        distance=distance,
        parameter=parameter,
    )


def contour_points(contour: Contour, parameters: Any) -> Float[np.ndarray, "n n_coordinates"]:
    """Return points of a contour [m].

    Parameters
    ----------
    contour
        The path.
    parameters
        Shape (n,).
    """
    wanted = np.asarray(parameters, float)
    size = next((size for size in _BATCHES if len(wanted) <= size), _BATCHES[-1])
    parts = [np.zeros((0, contour.n_axes))]
    for begin in range(0, len(wanted), size):  # of few sizes, so that little is compiled
        batch = wanted[begin : begin + size]
        padded = np.pad(batch, (0, size - len(batch)), mode="edge")
        parts.append(np.asarray(_points()(contour, padded))[: len(batch)])
    return np.concatenate(parts)


@functools.cache
def _points() -> Callable[..., Any]:
    import jax

    return jax.jit(lambda contour, p: jax.vmap(contour.position)(p))


def _parameters(contour: Contour, used: np.ndarray) -> np.ndarray:
    """Return parameters fine enough to draw the stretch of contour that was asked for, once."""
    start, end = (float(bound) for bound in contour.domain)
    low, high = float(used.min()), float(used.max())
    if not contour.closed:
        low, high = max(low, start), min(high, end)
    elif high - low > end - start:
        high = low + end - start
    breaks = np.asarray(getattr(contour, "breaks", np.zeros(0)), float)
    if contour.closed and len(breaks):
        laps = np.arange(
            math.floor((low - start) / (end - start)), 2 + (high - start) // (end - start)
        )
        breaks = (breaks + laps[:, None] * (end - start)).ravel()
    inner = breaks[(breaks > low) & (breaks < high)]
    even = np.linspace(low, high, max(4001, min(PATH_POINTS, len(used))))
    return np.unique(np.concatenate([even, inner]))


def _distances(
    contour: Contour, parameters: np.ndarray, points: np.ndarray
) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    """Return the distance along the path of a parameter, and the reverse."""
    if hasattr(contour, "breaks"):
        return (lambda p: np.asarray(p, float)), (lambda d: np.asarray(d, float))
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    low, span = parameters[0], parameters[-1] - parameters[0]

    def distance(p: Any) -> Any:
        lap = np.floor((np.asarray(p, float) - low) / span) if contour.closed else 0.0
        return lap * along[-1] + np.interp(p - lap * span, parameters, along)

    def parameter(d: Any) -> Any:
        lap = np.floor(np.asarray(d, float) / along[-1]) if contour.closed else 0.0
        return lap * span + np.interp(d - lap * along[-1], along, parameters)

    return distance, parameter


def _source_lines(contour: Contour, parameters: np.ndarray) -> np.ndarray:
    if not (hasattr(contour, "breaks") and hasattr(contour, "source_line")):
        return np.zeros(len(parameters), np.int32)
    breaks, lines = np.asarray(contour.breaks), np.asarray(contour.source_line, np.int32)
    at = np.nan_to_num(np.asarray(parameters, float))
    if contour.closed:
        at = breaks[0] + np.mod(at - breaks[0], breaks[-1] - breaks[0])
    return lines[np.searchsorted(breaks[1:-1], at, side="right")]  # type: ignore[no-any-return]


def _reach(comparison: Comparison, extent: float) -> float:
    """Return the contour error at which a diverged run leaves the picture [m]."""
    largest = [
        float(recording.metrics["contour_error_max"])  # type: ignore[arg-type]
        for recording in comparison.recordings.values()
        if not recording.diverged
    ]
    finite = [value for value in largest if math.isfinite(value) and value > 0.0]
    framed = [value for value in finite if value <= FAR_WORSE * min(finite)]
    return DIVERGED_SHOWN * max(framed) if framed else extent / 5.0


def _run(
    name: str, pair: tuple[str, str], recording: Recording, own: Look, contour: Contour,
    distance: Callable[[Any], Any], reach: float,
) -> Run:  # fmt: skip
    error = np.asarray(recording["contour_error"], float)
    vector = np.asarray(recording["contour_error_vector"], float)
    parameter = np.asarray(recording["foot_parameter"], float)
    end, worst = len(error), None
    if recording.diverged:
        gone = np.flatnonzero(~(np.abs(error) <= reach))
        end = max(int(gone[0]), 1) if len(gone) else end
    else:
        worst = int(np.argmax(np.nan_to_num(np.abs(error))))
    return Run(
        name=name, machine=pair[0], controller=pair[1], look=own, recording=recording,
        metrics=dict(recording.metrics),
        time=np.asarray(recording["time"], float)[:end],
        distance=np.asarray(distance(parameter[:end])),
        error=error[:end],
        foot=np.asarray(recording["tool"], float)[:end] + vector[:end],
        vector=vector[:end],
        line=_source_lines(contour, parameter[:end]),
        worst=worst,
    )  # fmt: skip


def _stops(comparison: Comparison, distance: Callable[[Any], Any]) -> Stops:
    reference = comparison.reference
    time = np.asarray(comparison.stops, float)
    rows = np.clip(np.searchsorted(reference.time, time), 0, reference.n_samples - 1)
    parameter = np.asarray(reference.parameter)[rows]
    points = contour_points(reference.contour, parameter)
    lines = _source_lines(reference.contour, parameter)
    return Stops(time, np.asarray(distance(parameter)), points, lines)


def _default_factor(runs: tuple[Run, ...], extent: float) -> float:
    """Return 1, 2 or 5 times a power of ten that makes the largest deviation plain to see.

    Runs far worse than the best do not count.
    """
    sizes = [run.largest for run in runs if not run.diverged] or [run.largest for run in runs]
    largest = max(size for size in sizes if size <= FAR_WORSE * min(sizes))
    if largest <= 0.0:
        return 1.0
    wanted = LARGEST_DEVIATION * extent / largest
    power = 10.0 ** math.floor(math.log10(wanted))
    return max(1.0, max(k * power for k in (1.0, 2.0, 5.0) if k * power <= wanted * (1 + 1e-9)))
