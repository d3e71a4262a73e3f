"""How good an estimate is: every estimator against the exact local foot point.

The actual point lags behind the reference on the contour, and lies beside it; see
:mod:`contourlab.contour_errors.accuracy_samples`. An estimator is given what a control loop would
give it, and its vector is compared with the exact one, from the *true* actual point to the foot
point near the reference. Two errors are kept, each with its mean and its largest value over the
judged places, which are evenly spread over the length of the contour:

    error        = | |estimate| - |exact| |     of the size: what the papers compare
    vector error = |estimate - exact|           of size and direction, also of the side

The second is what metrics call ``estimate_error``. It is never less than the first, which does not
see an estimate of the right size on the wrong side of the contour.

Estimators without a state see the places alone. One with a state follows the whole motion, sample
by sample, from ``start_up`` before it is judged, and is judged at the samples nearest to the
places: on a closed contour it runs in before the lap, on an open one its first stretch of
``feed * start_up`` is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contour_errors.accuracy_names import (
    named,
    study_estimators,
    study_named,
)
from contourlab.contour_errors.accuracy_run import has_state, nanoseconds_per_call, run_estimator
from contourlab.contour_errors.accuracy_samples import Motion, lagging_motion, places, stream
from contourlab.contour_errors.base import Estimator
from contourlab.contours import Contour, foot_point
from contourlab.errors import ConfigurationError, GeometryError, RefusedError, choices
from contourlab.feedrate.arc_length import ArcLength, arc_derivatives, contour_derivatives
from contourlab.units import parse_quantity

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["AccuracyRow", "AccuracyStudy", "StudiedContour", "estimate_accuracy"]

Values = NDArray[Any]

_MOST_SAMPLES = 1_000_000
_MOST_POINTS = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class AccuracyRow:
    """One estimator on one contour in one condition; figures are None where there is none."""

    contour: str
    estimator: str
    lag: float
    """Of the actual point behind the reference, along the contour [m]."""
    offset: float
    """Of the actual point from the contour along the normal, in space the binormal too [m]."""
    feed: float
    """Along the contour [m/s]."""
    resolution: float
    """Of the encoders [m]; 0 is exact."""
    error_mean: float | None = None
    """Mean of | |estimate| - |exact| | [m]."""
    error_max: float | None = None
    """Largest of it [m]."""
    vector_error_mean: float | None = None
    """Mean of |estimate - exact| [m]."""
    vector_error_max: float | None = None
    """Largest of it [m]."""
    cost_ns: float | None = None
    """Of one call in a compiled loop [ns]; None if it was not measured."""
    n_points: int = 0
    """Judged places."""
    note: str = ""
    """Why there are no figures."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudiedContour:
    """What a reader wants to know of a contour."""

    name: str
    n_axes: int
    """Coordinates."""
    closed: bool
    length: float
    """[m]."""
    curvature_max: float
    """Largest curvature at the places [1/m]."""
    description: str
    """Class and sizes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AccuracyStudy:
    """What ``estimate_accuracy`` found."""

    rows: tuple[AccuracyRow, ...]
    contours: tuple[StudiedContour, ...]
    sample_time: float
    """[s]."""
    start_up: float
    """Time that an estimator with a state runs before it is judged [s]."""
    points: int
    """Places asked for."""

    def to_pandas(self) -> pd.DataFrame:
        """Return the rows as a table; NaN where a figure is missing."""
        import pandas as pd

        names = [field.name for field in fields(AccuracyRow)]
        table = pd.DataFrame([[getattr(row, n) for n in names] for row in self.rows], columns=names)
        numbers = [n for n in names if n not in ("contour", "estimator", "note", "n_points")]
        return table.astype(dict.fromkeys(numbers, float))


def estimate_accuracy(
    contours: Any = None,
    estimators: Any = None,
    *,
    lag: Any = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3),
    offset: Any = 1e-5,
    feed: Any = 0.05,
    resolution: Any = 0.0,
    sample_time: float | str = 1e-3,
    points: int = 200,
    start_up: float | str = 0.1,
    cost: bool = True,
    progress: Callable[[str, float], None] | None = None,
) -> AccuracyStudy:
    """Compare contour error estimators with the exact local foot point.

    Every contour with every estimator, lag, offset, feed and resolution. Lengths, speeds and times
    are numbers in SI or texts with their unit; where several may stand, a sequence of them, or one
    text with commas.

    Parameters
    ----------
    contours
        A contour, a name of ``study_contours`` (hyphens count as underscores), a sequence of those
        or a mapping from names of your own; ellipse, figure of eight, helix and parabola if None.
    estimators
        Likewise, with the names of ``study_estimators``; all of them if None.
    lag
        How far the actual point is behind the reference along the contour, >= 0 [m].
    offset
        How far it is from the contour along the left normal, in space along the principal normal
        and again along the binormal [m].
    feed
        Of reference and actual point, > 0 [m/s]; matters to estimators with a state.
    resolution
        Of the encoders, >= 0 [m]: measured coordinates are rounded to its multiples; 0 is exact.
    sample_time
        > 0 [s]; matters to estimators with a state.
    points
        Places on each contour, from 2 to 100 000.
    start_up
        How long an estimator with a state follows the motion before it is judged, >= 0 [s].
    cost
        Whether to time the estimators, once in each condition.
    progress
        Called with a contour's name and the share that is done.

    Returns
    -------
    AccuracyStudy
        Its ``rows`` in the order contour, estimator, lag, offset, feed, resolution. Where a contour
        is refused by an estimator the figures are None and ``note`` says why.

    Raises
    ------
    ConfigurationError
        An unknown name; a number out of bounds; a unit that is missing or of another kind.
    RefusedError
        Nothing of it can be judged; gives the reasons.
    FeedError
        A contour without length, or with a cusp.
    """
    chosen = study_named(contours)
    known = study_estimators()
    judged = named("estimator", known if estimators is None else estimators, Estimator, known)
    asked = _Asked(
        lags=_quantities(lag, "length", "lag", minimum=0.0),
        offsets=_quantities(offset, "length", "offset"),
        feeds=_quantities(feed, "velocity", "feed", above=0.0),
        resolutions=_quantities(resolution, "length", "resolution", minimum=0.0),
        sample_time=_quantity(sample_time, "time", "sample_time", above=0.0),
        start_up=_quantity(start_up, "time", "start_up", minimum=0.0),
        points=_count(points),
        cost=cost,
    )
    rows: list[AccuracyRow] = []
    facts = []
    for name, contour in chosen.items():
        place = _Place(name, contour, asked)
        facts.append(place.facts)
        for k, (label, estimator) in enumerate(judged.items()):
            if progress is not None:
                progress(name, k / len(judged))
            rows += place.judge(label, estimator)
        if progress is not None:
            progress(name, 1.0)
    if all(row.note for row in rows):
        reasons = "; ".join(dict.fromkeys(f"{row.estimator} on {row.contour}: {row.note}"
                                          for row in rows))  # fmt: skip
        raise RefusedError(f"nothing can be judged: {reasons}. {choices('', known)}")
    return AccuracyStudy(
        rows=tuple(rows), contours=tuple(facts), sample_time=asked.sample_time,
        start_up=asked.start_up, points=asked.points,
    )  # fmt: skip


@dataclass(frozen=True)
class _Asked:
    lags: tuple[float, ...]
    offsets: tuple[float, ...]
    feeds: tuple[float, ...]
    resolutions: tuple[float, ...]
    sample_time: float
    start_up: float
    points: int
    cost: bool

    @property
    def n_before(self) -> int:
        """Samples before the first judged one."""
        return int(np.ceil(self.start_up / self.sample_time * (1.0 - 1e-12)))


@dataclass(frozen=True)
class _Judged:
    """A motion and the exact contour error on it."""

    motion: Motion
    rows: NDArray[np.intp]
    exact: Values
    """From the actual point to its foot, shape (n_offsets, n_rows, n_axes) [m]."""


class _Place:
    """One contour, and the motions on it, made when first asked for."""

    def __init__(self, name: str, contour: Contour, asked: _Asked) -> None:
        self.name, self.contour, self.asked = name, contour, asked
        self.table = ArcLength(contour)
        self.order = 2
        self._motions: dict[tuple[float, float, bool, int], _Judged | str] = {}

    @property
    def facts(self) -> StudiedContour:
        arc = places(self.table, 0.0, self.asked.points).arc
        bend = arc_derivatives(contour_derivatives(self.contour, self.table.parameter_at(arc)))
        return StudiedContour(
            name=self.name, n_axes=self.contour.n_axes, closed=bool(self.contour.closed),
            length=self.table.length, description=_describe(self.contour),
            curvature_max=float(np.max(np.linalg.norm(bend[:, 1], axis=1))),
        )  # fmt: skip

    def judge(self, label: str, estimator: Estimator) -> list[AccuracyRow]:
        """Return a row for each condition."""
        rows = []
        try:
            bound = estimator.bind(self.contour, self.asked.sample_time)
            for lag in self.asked.lags:
                found = [self._at(label, bound, lag, feed) for feed in self.asked.feeds]
                rows += [row for at in zip(*found, strict=True) for rows_ in at for row in rows_]
        except (GeometryError, RefusedError) as error:
            return self._without_figures(label, str(error))
        return rows

    def _at(self, label: str, bound: Estimator, lag: float, feed: float) -> list[list[AccuracyRow]]:
        asked = self.asked
        if lag >= self.table.length:
            reason = f"the lag is no less than the contour's length of {self.table.length:.6g} m"
            return self._no_figures(label, lag, feed, reason)
        order = bound.needs.derivatives
        state = has_state(bound, self._motion(lag, feed, False, order).motion)  # type: ignore[union-attr]
        judged = self._motion(lag, feed, state, order)
        if isinstance(judged, str):
            return self._no_figures(label, lag, feed, judged)
        resolution = np.asarray(asked.resolutions)
        estimates = run_estimator(bound, judged.motion, resolution, state=state)[:, :, judged.rows]
        cost = nanoseconds_per_call(bound, judged.motion) if asked.cost else None
        return [
            [
                _row(
                    estimates[k, r], judged.exact[k], contour=self.name, estimator=label, lag=lag,
                    offset=offset, feed=feed, resolution=size, cost_ns=cost,
                )
                for r, size in enumerate(asked.resolutions)
            ]
            for k, offset in enumerate(asked.offsets)
        ]  # fmt: skip

    def _motion(self, lag: float, feed: float, state: bool, order: int) -> _Judged | str:
        key = (lag, feed, state, max(order, 4))
        if key not in self._motions:
            self._motions[key] = self._make(lag, feed, state, order)
        return self._motions[key]

    def _make(self, lag: float, feed: float, state: bool, order: int) -> _Judged | str:
        asked = self.asked
        if not state:
            track = places(self.table, lag, asked.points)
        else:
            step = feed * asked.sample_time
            n_samples = self.table.length / step + asked.n_before
            if n_samples > _MOST_SAMPLES:
                return (
                    f"{n_samples:.3g} samples of {step:.3g} m to follow, more than "
                    f"{_MOST_SAMPLES:.0e}: a higher feed or a longer sample_time needs fewer"
                )
            streamed = stream(self.table, lag, asked.points, step, asked.n_before)
            if streamed is None:
                return (
                    f"the contour's {self.table.length:.3g} m end before start_up = "
                    f"{asked.start_up:.3g} s is over"
                )
            track = streamed
        motion = lagging_motion(
            self.table, track.arc, lag, np.asarray(asked.offsets), feed, asked.sample_time,
            max(order, 4),
        )  # fmt: skip
        actual = motion.position[:, track.judged]
        near = np.asarray(motion.reference.parameter)[track.judged]
        foot = foot_point(
            self.contour, actual.reshape(-1, self.contour.n_axes), np.tile(near, len(actual))
        )
        return _Judged(motion, track.judged, np.asarray(foot.vector).reshape(actual.shape))

    def _without_figures(self, label: str, reason: str) -> list[AccuracyRow]:
        asked = self.asked
        return [
            AccuracyRow(contour=self.name, estimator=label, lag=lag, offset=offset, feed=feed,
                        resolution=resolution, note=reason)
            for lag in asked.lags for offset in asked.offsets for feed in asked.feeds
            for resolution in asked.resolutions
        ]  # fmt: skip

    def _no_figures(
        self, label: str, lag: float, feed: float, reason: str
    ) -> list[list[AccuracyRow]]:
        return [
            [
                AccuracyRow(contour=self.name, estimator=label, lag=lag, offset=offset, feed=feed,
                            resolution=resolution, note=reason)
                for resolution in self.asked.resolutions
            ]
            for offset in self.asked.offsets
        ]  # fmt: skip


def _row(estimates: Values, exact: Values, **condition: Any) -> AccuracyRow:
    """Return a row with figures, or with a note if the estimates have none."""
    size = np.abs(np.linalg.norm(estimates, axis=1) - np.linalg.norm(exact, axis=1))
    vector = np.linalg.norm(estimates - exact, axis=1)
    lost = int(np.sum(~np.isfinite(vector)))
    if lost:
        note = f"{lost} of {len(vector)} estimates are not finite"
        return AccuracyRow(**{**condition, "cost_ns": None}, note=note)
    return AccuracyRow(
        **condition, error_mean=float(np.mean(size)), error_max=float(np.max(size)),
        vector_error_mean=float(np.mean(vector)), vector_error_max=float(np.max(vector)),
        n_points=len(vector),
    )  # fmt: skip


def _describe(contour: Contour) -> str:
    """Return the class of a contour and its sizes, defaults and long tables left out."""
    sizes = []
    for field in fields(contour):
        value = getattr(contour, field.name, None)
        array = np.zeros(0) if value is None else np.asarray(value)
        if not field.init or array.dtype.kind not in "fi" or not 0 < array.size <= 4:
            continue
        if field.default is None or not np.array_equal(array, np.asarray(field.default)):
            shown = ", ".join(f"{x:.6g}" for x in array.reshape(-1))
            sizes.append(f"{field.name}={f'({shown})' if array.ndim else shown}")
    return f"{type(contour).__name__}({', '.join(sizes)})"


def _quantities(
    given: Any, dimension: str, name: str, *, minimum: float = -np.inf, above: float = -np.inf
) -> tuple[float, ...]:
    """Return one number or several in SI, each once."""
    if isinstance(given, str):
        entries: Sequence[Any] = given.split(",")
    else:
        entries = list(np.atleast_1d(given)) if np.ndim(given) < 2 else [given]
    found = [_quantity(entry, dimension, name, minimum=minimum, above=above) for entry in entries]
    if not found:
        raise ConfigurationError(f"{name} must be a {dimension} or several, got none")
    return tuple(dict.fromkeys(found))


def _quantity(
    given: Any, dimension: str, name: str, *, minimum: float = -np.inf, above: float = -np.inf
) -> float:
    number = isinstance(given, int | float | np.number) and not isinstance(given, bool)
    value = float(given) if number else parse_quantity(given, dimension, name)
    unit = {"length": "m", "velocity": "m/s", "time": "s"}[dimension]
    bound = f">= {minimum:g} {unit} and " if minimum > -np.inf else ""
    bound = f"> {above:g} {unit} and " if above > -np.inf else bound
    if not (np.isfinite(value) and value >= minimum and value > above):
        raise ConfigurationError(f"{name} must be {bound}finite, got {value:g}")
    return value


def _count(points: Any) -> int:
    whole = isinstance(points, int | np.integer) and not isinstance(points, bool)
    if not whole or not 2 <= points <= _MOST_POINTS:
        raise ConfigurationError(
            f"points must be a whole number from 2 to {_MOST_POINTS}, got {points!r}"
        )
    return int(points)
