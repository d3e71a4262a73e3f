"""What varies between the samples of a variation, and by how much.

Each path has random numbers of its own, from the seed and the path's text alone: every controller
and every machine meets the same samples, and a path that is added leaves the others' numbers as
they are.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import resolve
from contourlab.errors import ConfigurationError, ContourlabError, SimulationError, choices
from contourlab.simulation.checks import check_seed
from contourlab.simulation.spread import check_lanes, full_path, refuse_ambiguous

__all__ = ["Listed", "Normal", "Uniform", "Variation", "find_field", "own_path"]


@dataclass(frozen=True, kw_only=True)
class Uniform:
    """Evenly distributed about the nominal value, or between two ends; give one of the three."""

    relative: float | None = None
    """Half width as a share of the nominal value: 0.2 is ±20 %."""
    absolute: float | None = None
    """Half width in the field's unit."""
    between: tuple[float, float] | None = None
    """Lower and upper end in the field's unit."""
    common: bool = False
    """Whether one draw holds for all axes; otherwise each axis has its own."""

    def __post_init__(self) -> None:
        _one_of(self, ("relative", "absolute", "between"))
        for name in ("relative", "absolute"):
            _positive(name, getattr(self, name))
        if self.between is not None and not (
            np.isfinite(self.between).all() and self.between[0] < self.between[1]
        ):
            raise SimulationError(f"between must be lower < upper, got {self.between!r}")

    def values(
        self, nominal: NDArray[Any], samples: int, random: np.random.Generator
    ) -> NDArray[Any]:
        """Return the values of every sample, shape (samples, *nominal.shape).

        Parameters
        ----------
        nominal
            The field as it stands.
        samples
            How many.
        random
            Where the numbers come from.
        """
        share = random.uniform(-1.0, 1.0, _shape(self.common, samples, nominal))
        if self.between is not None:
            low, high = self.between
            drawn: NDArray[Any] = low + 0.5 * (share + 1.0) * (high - low)
            return np.broadcast_to(drawn, (samples, *nominal.shape))
        width = _width(self.relative, self.absolute, nominal)
        return nominal + share * width  # type: ignore[no-any-return]


@dataclass(frozen=True, kw_only=True)
class Normal:
    """Normally distributed about the nominal value; give one of the two."""

    relative: float | None = None
    """Standard deviation as a share of the nominal value."""
    absolute: float | None = None
    """Standard deviation in the field's unit."""
    common: bool = False
    """Whether one draw holds for all axes; otherwise each axis has its own."""

    def __post_init__(self) -> None:
        _one_of(self, ("relative", "absolute"))
        for name in ("relative", "absolute"):
            _positive(name, getattr(self, name))

    def values(
        self, nominal: NDArray[Any], samples: int, random: np.random.Generator
    ) -> NDArray[Any]:
        """Return the values of every sample, shape (samples, *nominal.shape).

        Parameters
        ----------
        nominal
            The field as it stands.
        samples
            How many.
        random
            Where the numbers come from.
        """
        share = random.standard_normal(_shape(self.common, samples, nominal))
        width = _width(self.relative, self.absolute, nominal)
        return nominal + share * width  # type: ignore[no-any-return]


@dataclass(frozen=True, kw_only=True)
class Listed:
    """Values written out, one per sample; give one of the two."""

    values_of: Sequence[Any] | NDArray[Any] | None = None
    """In the field's unit; each a number, or one per axis."""
    factors: Sequence[float] | None = None
    """Times the nominal value."""

    def __post_init__(self) -> None:
        _one_of(self, ("values_of", "factors"))
        if not len(self):
            raise SimulationError("a list of values must not be empty")
        try:
            kind = np.asarray(self.values_of if self.factors is None else self.factors).dtype.kind
        except ValueError:  # rows of different lengths
            raise SimulationError(
                "listed values must all be numbers, or all be lists of the same length, "
                "with one number per axis"
            ) from None
        if kind not in "iuf":
            raise SimulationError("listed values must be numbers")

    def __len__(self) -> int:
        return len(self.values_of if self.factors is None else self.factors)  # type: ignore[arg-type]

    def values(self, nominal: NDArray[Any], picked: NDArray[Any]) -> NDArray[Any]:
        """Return the values of every sample, (samples,) or (samples, *nominal.shape).

        Parameters
        ----------
        nominal
            The field as it stands.
        picked
            Which value each sample has, shape (samples,).
        """
        if self.factors is None:
            return np.asarray(self.values_of)[picked]  # type: ignore[no-any-return]
        factors = np.asarray(self.factors, float)[picked]
        scaled: NDArray[Any] = factors.reshape(-1, *([1] * nominal.ndim)) * nominal
        return scaled


Change = Uniform | Normal | Listed


@dataclass(frozen=True, kw_only=True)
class Variation:
    """What varies, and how many samples are run.

    Paths are those of ``simulate_many``, such as ``"machine.mass"``, ``"controller.kp"``,
    ``"disturbances.0.amplitude"``; a name after ``machine`` or ``controller``, as in
    ``"controller.cascade.kp"``, limits a path to that one. Sample k has the noise seed of the run
    plus k, unless ``"seed"`` is listed.
    """

    changes: Mapping[str, Change]
    samples: int | None = None
    """How many; may be left out if values are listed."""
    seed: int = 0
    """Of the draws."""
    grid: bool = False
    """Whether listed values are combined, each with each, rather than zipped."""

    def __post_init__(self) -> None:
        check_seed(self.seed)
        if not self.changes:
            raise SimulationError("vary names nothing to vary")
        lists = {path: c for path, c in self.changes.items() if isinstance(c, Listed)}
        if self.samples is not None and (
            isinstance(self.samples, bool) or not isinstance(self.samples, int) or self.samples < 1
        ):
            raise SimulationError(f"samples must be a whole number >= 1, got {self.samples!r}")
        if self.grid:
            if len(lists) < len(self.changes):
                drawn = next(path for path in self.changes if path not in lists)
                raise SimulationError(f"grid combines listed values; {drawn} is drawn")
            return
        lengths = {path: len(change) for path, change in lists.items()}
        counts = {*lengths.values(), *([self.samples] if self.samples is not None else [])}
        if len(counts) > 1:
            shown = ", ".join(f"{path} has {length}" for path, length in lengths.items())
            asked = f"samples = {self.samples}, " if self.samples is not None else ""
            raise SimulationError(
                f"listed values are zipped and need one for each sample: {asked}{shown}; "
                "grid combines them instead"
            )
        if not counts:
            raise SimulationError("samples is missing: how many samples are drawn")

    @property
    def n_samples(self) -> int:
        """How many samples are run."""
        if self.grid:
            return int(np.prod([len(c) for c in self.changes.values()]))  # type: ignore[arg-type]
        lists = [len(c) for c in self.changes.values() if isinstance(c, Listed)]
        return lists[0] if lists else int(self.samples or 0)

    def lanes(
        self, loop: Mapping[str, Any], *, machine: str, controller: str,
        machines: Sequence[str], controllers: Sequence[str], seed: int,
    ) -> dict[str, NDArray[Any]]:  # fmt: skip
        """Return the values of every sample for one loop, by path, checked; ``seed`` among them.

        Parameters
        ----------
        loop
            ``machine``, ``controller`` and ``disturbances``.
        machine, controller
            Names of the two.
        machines, controllers
            All names, which a path may hold.
        seed
            Of the nominal run's noise.

        Raises
        ------
        SimulationError
            A path that names nothing here, or a value out of bounds; says which, and of whom.
        """
        n = self.n_samples
        picked = self._picked(n)
        lanes: dict[str, NDArray[Any]] = {"seed": seed + np.arange(n)}
        named: dict[str, str] = {}
        for path, change in self.changes.items():
            own = own_path(path, machine, controller, machines, controllers)
            if own != path:
                refuse_ambiguous(loop, path)
            if own is None:
                continue
            drawn = False
            try:
                full = own if own == "seed" else full_path(loop, own)
                if full in named:
                    same = f"{path} and {named[full]} name the same value, {full}"
                    raise SimulationError(same)
                named[full] = path
                lanes[own] = self._lane(loop, path, own, picked[path])
                drawn = True
                check_lanes(loop, {own: lanes[own]})
            except ContourlabError as error:
                whose = f"controller {controller}" if own.startswith("controller") else machine
                whose = f"machine {whose}" if own.startswith("machine") else whose
                out_of_bounds = drawn and isinstance(error, ConfigurationError)
                unbounded = out_of_bounds and isinstance(change, Normal)
                hint = "; a normal distribution has no bounds" if unbounded else ""
                message = str(error).removeprefix("vary: ")
                raise SimulationError(f"vary: {path} ({whose}): {message}{hint}") from error
        try:
            check_lanes(loop, lanes)
        except ConfigurationError as error:
            raise SimulationError(f"vary: {error}") from error
        return lanes

    def _lane(
        self, loop: Mapping[str, Any], path: str, own: str, picked: NDArray[Any]
    ) -> NDArray[Any]:
        """Return the values of one path, not checked yet."""
        change = self.changes[path]
        if own == "seed":
            return self._seeds(change, picked)
        nominal = _nominal(loop, own)
        if isinstance(change, Listed):
            if change.factors is not None:
                _scalable(nominal, own)
            return change.values(nominal, picked)
        if change.relative is not None:
            _scalable(nominal, own)
        random = np.random.default_rng([self.seed, zlib.crc32(path.encode())])
        return change.values(nominal, self.n_samples, random)

    def _picked(self, n: int) -> dict[str, NDArray[Any]]:
        """Return which of its listed values each sample has, by path."""
        if not self.grid:
            return dict.fromkeys(self.changes, np.arange(n))
        places = np.array(list(product(*(range(len(c)) for c in self.changes.values()))))  # type: ignore[arg-type]
        return dict(zip(self.changes, places.T, strict=True))

    @staticmethod
    def _seeds(change: Change, picked: NDArray[Any]) -> NDArray[Any]:
        if not isinstance(change, Listed) or change.factors is not None:
            raise SimulationError("seeds can only be listed as values")
        seeds = np.asarray(change.values_of)
        if seeds.dtype.kind not in "iu" or seeds.ndim != 1 or (seeds < 0).any():
            raise SimulationError("seeds must be whole numbers >= 0")
        return seeds[picked]  # type: ignore[no-any-return]


def own_path(
    path: str, machine: str, controller: str, machines: Sequence[str], controllers: Sequence[str]
) -> str | None:
    """Return a path without the name of machine or controller; None if it is of another one.

    Parameters
    ----------
    path
        As a user writes it.
    machine, controller
        Names of the two of a loop.
    machines, controllers
        All names.

    Raises
    ------
    SimulationError
        It begins with nothing that varies.
    """
    head, _, rest = path.partition(".")
    if head not in ("machine", "controller", "disturbances") and path != "seed":
        allowed = ["machine", "controller", "disturbances", "seed"]
        raise SimulationError(f"vary: {path!r} begins with {head!r}; {choices(head, allowed)}")
    if path != "seed" and not rest:
        raise SimulationError(f"vary: {path!r} needs the name of a value, such as {head}.name")
    own, names = (machine, machines) if head == "machine" else (controller, controllers)
    if head in ("machine", "controller"):
        for name in sorted(names, key=len, reverse=True):
            if rest.startswith(f"{name}."):
                return f"{head}.{rest[len(name) + 1 :]}" if name == own else None
    return path


def find_field(loop: Mapping[str, Any], path: str) -> tuple[Any, Any]:
    """Return the value at a path of a loop, and the dataclass field that declares it.

    Parameters
    ----------
    loop
        ``machine``, ``controller`` and ``disturbances``.
    path
        As ``own_path`` returned it; may leave levels out.

    Raises
    ------
    ConfigurationError
        It names nothing, or several things.
    """
    value, declared = loop, None
    for name in resolve(loop, path).split("."):
        if isinstance(value, Mapping):
            value = value[name]
        elif isinstance(value, tuple):
            value = value[int(name)]
        else:
            declared = value.__dataclass_fields__[name]
            value = getattr(value, name)
    return value, declared


def _nominal(loop: Mapping[str, Any], path: str) -> NDArray[Any]:
    """Return a number of the loop; one for all axes as one per axis, which may differ."""
    value, declared = find_field(loop, path)
    metadata = declared.metadata.get("real") if declared is not None else None
    if metadata is None or value is None:
        raise SimulationError("is not a number that can be varied in a batch")
    array = np.asarray(value)
    if array.ndim == 0 and metadata.get("ndim") == 1:
        return np.broadcast_to(array, (int(loop["machine"].n_axes),))
    return array


def _width(relative: float | None, absolute: float | None, nominal: NDArray[Any]) -> NDArray[Any]:
    if relative is None:
        return np.asarray(absolute)
    return np.asarray(np.abs(nominal) * relative)


def _shape(common: bool, samples: int, nominal: NDArray[Any]) -> tuple[int, ...]:
    return (samples, *([1] * nominal.ndim if common else nominal.shape))


def _scalable(nominal: NDArray[Any], path: str) -> None:
    if not np.isfinite(nominal).all():
        raise SimulationError(f"{path} is not finite here, so a share of it means nothing")
    if not nominal.any():
        raise SimulationError(
            f"{path} is 0 here, so a share of it changes nothing; give an absolute width or values"
        )


def _one_of(change: Any, names: tuple[str, ...]) -> None:
    if sum(getattr(change, name) is not None for name in names) != 1:
        raise SimulationError(f"{type(change).__name__} needs exactly one of {', '.join(names)}")


def _positive(name: str, value: float | None) -> None:
    if value is not None and not (np.isfinite(value) and value > 0.0):
        raise SimulationError(f"{name} must be finite and > 0, got {value!r}")
