"""The ``[vary]`` section of a scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from contourlab.errors import ConfigurationError, ContourlabError, choices
from contourlab.scenarios.locate import Key
from contourlab.scenarios.schema import VarySection
from contourlab.scenarios.values import KeyedError, at, field_value, needs_unit
from contourlab.simulation.draws import Change, Listed, Normal, Uniform, Variation, find_field
from contourlab.simulation.draws import own_path as without_name
from contourlab.simulation.pairing import Loop
from contourlab.simulation.spread import check_variable

__all__ = ["absent_paths", "build_variation"]

NOISE_SEED = "simulation.seed"
"""What the seed of the noise is called here; ``seed`` itself is that of the draws."""
_UNIFORM, _NORMAL, _LISTED = (
    {"relative": "relative", "absolute": "absolute", "between": "between"},
    {"relative_std": "relative", "std": "absolute"},
    {"values": "values_of", "factors": "factors"},
)
_IN_UNITS = {"absolute", "between", "std", "values"}
_KEYS = [*_UNIFORM, *_NORMAL, *_LISTED, "distribution", "common"]


def build_variation(
    section: VarySection, loops: Sequence[Loop], seed: int, machines: list[str],
    controllers: list[str], absent: Sequence[str] = (),
) -> Variation | None:  # fmt: skip
    """Return what varies, checked for every controller on every machine.

    Parameters
    ----------
    section
        ``[vary]``.
    loops
        All that will run.
    seed
        ``[simulation] seed``.
    machines, controllers
        All names, those that are refused among them.
    absent
        Paths that are left out, of :func:`absent_paths`; None is returned if these are all.

    Raises
    ------
    KeyedError
        Something in it is wrong; says at which key, and of which controller or machine.
    """
    changes: dict[str, Change] = {}
    for written, value in _entries(section.model_extra or {}, ()):
        if written in absent:
            continue
        key: Key = ("vary", *written.split("."))
        path = "seed" if written == NOISE_SEED else written
        if path in changes:
            raise KeyedError(key, "stands already")
        with at(*key):
            dimension = _dimension(path, loops, machines, controllers)
        changes[path] = _change(value, key, dimension)
    if absent and not changes:
        return None
    with at("vary"):
        variation = Variation(
            changes=changes, samples=section.samples, seed=section.seed, grid=section.grid
        )
    for path, change in changes.items():
        with at("vary", *(NOISE_SEED if path == "seed" else path).split(".")):
            alone = Variation(
                changes={path: change}, grid=section.grid, seed=section.seed,
                samples=None if isinstance(change, Listed) else variation.n_samples,
            )  # fmt: skip
            for loop in loops:
                _check(alone, loop, machines, controllers, seed)
    with at("vary"):
        for loop in loops:
            _check(variation, loop, machines, controllers, seed)
    return variation


def absent_paths(
    section: VarySection, loops: Sequence[Loop], machines: list[str], controllers: list[str]
) -> tuple[str, ...]:
    """Return what cannot vary because only laws that were refused have it, as it is written.

    Parameters
    ----------
    section, loops, machines, controllers
        As for :func:`build_variation`.
    """
    return tuple(
        written for written, _ in _entries(section.model_extra or {}, ())
        if not _varies("seed" if written == NOISE_SEED else written, loops, machines, controllers)
    )  # fmt: skip


def _check(
    variation: Variation, loop: Loop, machines: list[str], controllers: list[str], seed: int
) -> None:
    try:
        lanes = variation.lanes(
            loop.parts, machine=loop.machine_name, controller=loop.controller_name,
            machines=machines, controllers=controllers, seed=seed,
        )  # fmt: skip
        check_variable(loop.controller, lanes)
    except ContourlabError as error:  # the key says already where it stands
        raise ConfigurationError(str(error).removeprefix("vary: ")) from error


def _entries(table: Mapping[str, Any], above: tuple[str, ...]) -> list[tuple[str, Any]]:
    """Return paths and what is said of them; ``machine.mass`` may be quoted or not."""
    found: list[tuple[str, Any]] = []
    for name, value in table.items():
        path = (*above, name)
        if isinstance(value, Mapping) and any(isinstance(v, Mapping) for v in value.values()):
            found += _entries(value, path)
        else:
            found.append((".".join(path), value))
    return found


def _varies(path: str, loops: Sequence[Loop], machines: list[str], controllers: list[str]) -> bool:
    """Return whether a path names something in any loop that runs."""
    try:
        return any(
            without_name(path, loop.machine_name, loop.controller_name, machines, controllers)
            is not None
            for loop in loops
        )
    except ContourlabError:
        return True  # said by what reads it


def _dimension(
    path: str, loops: Sequence[Loop], machines: list[str], controllers: list[str]
) -> str | None:
    """Return the kind of quantity that a path's values are written as."""
    for loop in loops:
        try:
            own = without_name(path, loop.machine_name, loop.controller_name, machines, controllers)
        except ContourlabError as error:
            raise ConfigurationError(str(error).removeprefix("vary: ")) from error
        if own is None or own == "seed":
            continue
        try:
            _, declared = find_field(loop.parts, own)
        except ContourlabError:
            continue  # said below, with the name of the controller or machine that lacks it
        return needs_unit(declared) if declared is not None else None
    return None


def _change(value: Any, key: Key, dimension: str | None) -> Change:
    table = {"values": value} if isinstance(value, list) else value
    if not isinstance(table, Mapping):
        raise KeyedError(
            key, f"must be a list of values or a table such as {{ relative = 0.2 }}, got {value!r}"
        )
    unknown = next((name for name in table if name not in _KEYS), None)
    if unknown is not None:
        raise KeyedError(key, f"unknown key {unknown!r}; {choices(unknown, _KEYS)}")
    said = dict(table)
    distribution, common = said.pop("distribution", None), said.pop("common", False)
    if not isinstance(common, bool):
        raise KeyedError(key, f"common must be true or false, got {common!r}")
    kind, names = next(
        (
            (kind, names)
            for kind, names in ((Uniform, _UNIFORM), (Normal, _NORMAL), (Listed, _LISTED))
            if any(name in said for name in names)
        ),
        (None, {}),
    )
    if kind is None or len(said) != 1:
        raise KeyedError(
            key,
            "needs exactly one of relative, absolute, between (uniform), relative_std, std "
            f"(normal), values, factors (listed), got {', '.join(said) or 'none'}",
        )
    named = {Uniform: "uniform", Normal: "normal"}
    if distribution is not None and distribution not in named.values():
        raise KeyedError(
            key, f"unknown distribution {distribution!r}; {choices(distribution, named.values())}"
        )
    name, given = next(iter(said.items()))
    if distribution is not None and named.get(kind) != distribution:
        shown = named.get(kind, "listed values")
        raise KeyedError(
            key, f"{name} goes with {shown}, not with distribution {distribution!r}; "
            "relative, absolute and between are uniform, relative_std and std are normal"
        )  # fmt: skip
    if common and kind is Listed:
        raise KeyedError(key, "common goes with draws; a listed number holds for all axes anyway")
    with at(*key):
        number = _number(
            name, given, dimension if name in _IN_UNITS else None,
            whole=key == ("vary", *NOISE_SEED.split(".")),
        )  # fmt: skip
        fields: dict[str, Any] = {names[name]: number}
        if kind is not Listed:
            fields["common"] = common
        return kind(**fields)


def _number(name: str, given: Any, dimension: str | None, *, whole: bool) -> Any:
    lists = name in ("between", "values", "factors")
    if isinstance(given, list) != lists:
        raise ConfigurationError(f"{name} must be a {'list' if lists else 'single value'}")
    if whole and lists:
        if any(isinstance(v, bool) or not isinstance(v, int) for v in given):
            raise ConfigurationError(f"{name} of seed must be whole numbers")
        return given
    number = field_value(name, given, dimension)
    if name == "between":
        if len(number) != 2 or any(isinstance(v, list) for v in number):
            raise ConfigurationError(f"between must be a lower and an upper end, got {given!r}")
        return tuple(number)
    if name == "factors" and any(isinstance(v, list) for v in number):
        raise ConfigurationError("factors must be numbers")
    return number
