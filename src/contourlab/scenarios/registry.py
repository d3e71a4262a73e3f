"""Names on the command line and in scenarios, and the classes they stand for."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any

from contourlab.errors import ConfigurationError, choices
from contourlab.simulation.checks import snake_case

__all__ = ["contours", "controllers", "disturbances", "estimators", "frames", "lookup", "machines"]


def _classes(package: Any, base: type, suffix: str = "") -> dict[str, type]:
    found = {}
    for name in package.__all__:
        value = getattr(package, name)
        if inspect.isclass(value) and issubclass(value, base) and not inspect.isabstract(value):
            found[snake_case(name.removesuffix(suffix) if suffix else name)] = value
    return found


@functools.cache
def contours() -> dict[str, type]:
    """Return formula contours by name."""
    from contourlab import contours as package

    found = _classes(package, package.Contour)
    found.pop("path", None)
    return found


@functools.cache
def controllers() -> dict[str, type]:
    """Return controllers by name."""
    from contourlab import controllers as package

    return _classes(package, package.Controller)


@functools.cache
def estimators() -> dict[str, type]:
    """Return estimators by name, without their ``Estimator``."""
    from contourlab import contour_errors as package

    return _classes(package, package.Estimator, "Estimator")


@functools.cache
def frames() -> dict[str, type]:
    """Return task frames by name."""
    from contourlab import controllers as package

    return _classes(package, package.TaskFrame)


@functools.cache
def disturbances() -> dict[str, type]:
    """Return disturbances by name, without their ``Disturbance``."""
    from contourlab import machines as package

    found = _classes(package, package.Disturbance, "Disturbance")
    return {name: value for name, value in found.items() if name}


@functools.cache
def machines() -> dict[str, Callable[..., Any]]:
    """Return the functions that make example and published machines, by name."""
    from contourlab.machines import examples, published

    return {
        name: getattr(package, name)
        for package in (examples, published)
        for name in package.__all__
    }


def lookup(kind: str, name: object, table: dict[str, Any]) -> Any:
    """Return what a name stands for; hyphens count as underscores.

    Parameters
    ----------
    kind
        What is looked up, for the message.
    name
        As written.
    table
        Of one of the functions above.

    Raises
    ------
    ConfigurationError
        No such name; lists the allowed ones.
    """
    key = name.replace("-", "_") if isinstance(name, str) else name
    if not isinstance(key, str) or key not in table:
        raise ConfigurationError(f"unknown {kind} {name!r}; {choices(name, table)}")
    return table[key]
