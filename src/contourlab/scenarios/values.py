"""From values in a scenario to the fields of a configuration."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NoReturn

from contourlab.errors import (
    ConfigurationError,
    ContourlabError,
    PartError,
    RefusedError,
    choices,
)
from contourlab.scenarios.locate import Key
from contourlab.units import parse_quantity

__all__ = ["KeyedError", "KeyedRefusedError", "at", "field_value", "make", "needs_unit"]

_DIMENSIONS = {
    "m": "length",
    "s": "time",
    "rad": "angle",
    "m/s": "velocity",
    "m/s^2": "acceleration",
    "m/s^3": "jerk",
}


class KeyedError(ContourlabError):
    """A mistake at a key of a scenario, before file and line are known."""

    def __init__(self, key: Key, message: str) -> None:
        self.key, self.message = key, message
        super().__init__(message)


class KeyedRefusedError(KeyedError):
    """A law that a machine or the contour does not take: right elsewhere, so no mistake."""


@contextmanager
def at(*key: str | int) -> Iterator[None]:
    """Give errors the key of the scenario that they belong to.

    Errors that have a key already, and those of a part program, which name its file and line, pass
    as they are.

    Parameters
    ----------
    *key
        Where in the scenario.

    Raises
    ------
    KeyedError
        In place of any other error of ours.
    """
    try:
        yield
    except (KeyedError, PartError):
        raise
    except ContourlabError as error:
        raise _keyed(error, key, str(error)) from error


def needs_unit(field: Any) -> str | None:
    """Return the kind of quantity that a field must be written as, None if a number will do.

    Parameters
    ----------
    field
        A dataclass field.
    """
    unit = field.metadata.get("real", {}).get("unit", "")
    return None if field.name.endswith("_hz") else _DIMENSIONS.get(unit)


def field_value(name: str, value: Any, dimension: str | None) -> Any:
    """Return a value, or nested lists of them, in SI.

    Parameters
    ----------
    name
        Of the field, for messages.
    value
        As TOML gave it.
    dimension
        Kind of quantity, or None for plain numbers.

    Raises
    ------
    UnitError
        A unit is missing or wrong.
    ConfigurationError
        Not a number.
    """
    if isinstance(value, list):
        return [field_value(name, item, dimension) for item in value]
    if dimension is not None:
        return parse_quantity(value, dimension, name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigurationError(f"{name} must be a number, got {value!r}")
    return float(value)


def make(
    kind: type, values: Mapping[str, Any], key: Key, *, given: Mapping[str, Any] | None = None,
    parts: Mapping[str, Any] | None = None,
) -> Any:  # fmt: skip
    """Return a configuration of a class from a table of a scenario.

    Parameters
    ----------
    kind
        A Configuration class.
    values
        The table's entries; ``tuning`` names a rule of the class (``by_<tuning>``) that computes
        the gains from the other entries.
    key
        Where the table stands.
    given
        Fields that do not come from the table, such as the model.
    parts
        For fields that are configurations themselves: functions from entry and key to the part.

    Raises
    ------
    KeyedError
        An unknown key, a missing one, or a wrong value.
    """
    given, parts, values = dict(given or {}), dict(parts or {}), dict(values)
    fields = {f.name: f for f in dataclasses.fields(kind) if f.init and f.name not in given}
    rule, target = None, kind
    if "tuning" in values and "tuning" not in fields:
        rules = {n.removeprefix("by_"): getattr(kind, n) for n in dir(kind) if n.startswith("by_")}
        name = values.pop("tuning")
        if name not in rules:
            _fail((*key, "tuning"), f"unknown tuning {name!r}; {choices(name, rules)}")
        rule = target = rules[name]
    arguments = set(inspect.signature(rule).parameters) - {"settings", *given} if rule else set()
    known = {*fields, *arguments}
    made = dict(given)
    for name, value in values.items():
        if name not in known:
            extra = " (and tuning)" if any(n.startswith("by_") for n in dir(kind)) else ""
            _fail((*key, name), f"unknown key; {choices(name, known)}{extra}")
        try:
            if name in parts:
                made[name] = parts[name](value, (*key, name))
            elif name in fields and "choice" in fields[name].metadata:
                made[name] = value
            else:
                field = fields.get(name)
                single = field is not None and field.metadata.get("real", {}).get("ndim") == 0
                if single and isinstance(value, list):
                    _fail((*key, name), f"must be a single value, got {value!r}")
                made[name] = field_value(name, value, needs_unit(field) if field else None)
        except KeyedError:
            raise
        except ContourlabError as error:
            raise _keyed(error, (*key, name), str(error)) from None
    try:
        return target(**made)
    except ContourlabError as error:
        named = [name for name in values if str(error).startswith(f"{name} ")]
        raise _keyed(error, (*key, named[0]) if named else key, str(error)) from None
    except TypeError:
        missing = _missing(rule, made) if rule else [
            name for name, f in fields.items()
            if name not in made and f.default is dataclasses.MISSING
            and f.default_factory is dataclasses.MISSING
        ]  # fmt: skip
        if not missing:
            raise
        _fail(key, f"{kind.__name__} needs {', '.join(missing)}")


def _missing(function: Any, made: Mapping[str, Any]) -> list[str]:
    parameters = inspect.signature(function).parameters.values()
    return [
        p.name
        for p in parameters
        if p.default is p.empty and p.kind is not p.VAR_KEYWORD and p.name not in made
    ]


def _keyed(error: ContourlabError, key: Key, message: str) -> KeyedError:
    return (KeyedRefusedError if isinstance(error, RefusedError) else KeyedError)(key, message)


def _fail(key: Key, message: str) -> NoReturn:
    raise KeyedError(key, message) from None
