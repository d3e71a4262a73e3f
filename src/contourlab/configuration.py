"""Frozen configurations: keyword-only Equinox modules that convert and check what they are given.

Numbers become float64 array leaves, so that changing a gain neither recompiles a loop nor blocks
``vmap`` and ``grad``; whatever decides the *structure* (counts, flags, choice of law) is static.
Leaves are converted with NumPy unless they are JAX arrays already: ten times cheaper, and nothing
lands on a device before it is needed.

Checks are elementwise: a leaf with a leading batch dimension is checked as a whole. They are
skipped for traced values, which have no value yet.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping
from typing import Any, TypeVar, cast, dataclass_transform

import equinox as eqx
import jax
import numpy as np

from contourlab.errors import ConfigurationError, choices

__all__ = [
    "Configuration",
    "configurable",
    "is_concrete",
    "part",
    "real",
    "replace",
    "replace_at",
    "resolve",
    "snake_case",
    "static",
]


def is_concrete(value: object) -> bool:
    """Return whether a value is known now, and not a tracer of ``jit``, ``vmap`` or ``grad``.

    Parameters
    ----------
    value
        Anything.
    """
    return not isinstance(value, jax.core.Tracer)


def as_leaf(value: Any) -> Any:
    """Return numbers as a float64 array; whatever is none unchanged, for check_real to refuse."""
    if isinstance(value, jax.Array):
        same = value.dtype == np.float64 or value.dtype.kind in "bc"
        return value if same else value.astype(np.float64)
    if isinstance(value, float | int) and not isinstance(value, bool):
        return np.asarray(value, np.float64)
    if not isinstance(value, np.ndarray | np.generic | list | tuple):
        return value
    try:
        array = np.asarray(value)
    except ValueError:  # ragged
        return value
    return array.astype(np.float64) if array.size == 0 or array.dtype.kind in "fiu" else value


def real(
    *,
    unit: str = "",
    minimum: float | None = None,
    above: float | None = None,
    maximum: float | None = None,
    below: float | None = None,
    finite: bool = True,
    ndim: int | None = None,
    **keywords: Any,
) -> Any:
    """Declare a field that holds real numbers: one float64 array leaf.

    Parameters
    ----------
    unit
        SI unit, used in messages and in generated code.
    minimum, above, maximum, below
        Bounds: ≥ minimum, > above, ≤ maximum, < below, each element on its own.
    finite
        Whether infinities and NaN are refused. NaN is always refused.
    ndim
        Number of dimensions of one value (0 scalar, 1 per axis, 2 matrix); a single number is
        accepted for ``ndim=1`` and then holds for every axis. Unchecked when None.
    **keywords
        Passed to ``dataclasses.field``, such as ``default``.
    """
    bounds = {
        "unit": unit, "minimum": minimum, "above": above, "maximum": maximum, "below": below,
        "finite": finite, "ndim": ndim,
    }  # fmt: skip
    return eqx.field(converter=as_leaf, metadata={"real": bounds}, kw_only=True, **keywords)


def _plain_flag(value: Any) -> Any:
    return bool(value) if isinstance(value, np.bool_) else value


def static(
    *,
    allowed: tuple[Any, ...] | None = None,
    minimum: int | None = None,
    flag: bool = False,
    **keywords: Any,
) -> Any:
    """Declare a field that decides structure: a count, a flag, a name. Not a leaf.

    Parameters
    ----------
    allowed
        The values that may be chosen; unchecked when None.
    minimum
        Least value of a count.
    flag
        Whether the field is a flag: only True and False are accepted.
    **keywords
        Passed to ``dataclasses.field``, such as ``default``.
    """
    rule = {"allowed": allowed, "minimum": minimum, "flag": flag}
    if flag:
        keywords["converter"] = _plain_flag
    return eqx.field(static=True, metadata={"choice": rule}, kw_only=True, **keywords)


def part(**keywords: Any) -> Any:
    """Declare a field that holds another configuration, or a tuple of them.

    Parameters
    ----------
    **keywords
        Passed to ``dataclasses.field``, such as ``default``.
    """
    return eqx.field(kw_only=True, **keywords)


@dataclass_transform(kw_only_default=True, field_specifiers=(real, static, part))
class Configuration(eqx.Module):
    """Base of every configuration: frozen, keyword-only, checked when it is made.

    Subclasses declare fields with :func:`real`, :func:`static` and :func:`part`, and may add a
    method ``check`` for what concerns several fields; it is called only when every leaf is known.
    """

    def __check_init__(self) -> None:
        for field in dataclasses.fields(self):
            if not hasattr(self, field.name):
                continue
            value = getattr(self, field.name)
            if value is None and field.default is None:
                continue
            if "real" in field.metadata:
                check_real(field.name, value, **field.metadata["real"])
            elif "choice" in field.metadata:
                check_static(field.name, value, **field.metadata["choice"])
        if type(self).check is not Configuration.check and all(
            is_concrete(leaf) and isinstance(leaf, jax.Array | np.ndarray | float | int)
            for leaf in jax.tree.leaves(self)
        ):
            self.check()

    def check(self) -> None:
        """Check what concerns several fields together; raise ConfigurationError if it is wrong.

        Must be elementwise: leaves may carry a leading batch dimension.
        """


_NO_NUMBERS = (
    str, bytes, bool, complex, np.generic, Mapping, list, tuple, set, frozenset, eqx.Module
)  # fmt: skip
"""What is refused as a number; numbers, and sequences of them, are arrays by then."""


def check_real(
    name: str,
    value: Any,
    *,
    unit: str = "",
    minimum: float | None = None,
    above: float | None = None,
    maximum: float | None = None,
    below: float | None = None,
    finite: bool = True,
    ndim: int | None = None,
) -> None:
    """Raise ConfigurationError unless every element of a known value is within its bounds."""
    if value is None or isinstance(value, _NO_NUMBERS):
        raise ConfigurationError(f"{name} must be a number, got {value!r}")
    if not isinstance(value, jax.Array | np.ndarray):
        return  # placeholders that JAX puts in while it rebuilds a tree
    if value.dtype.kind not in "fiu":
        raise ConfigurationError(f"{name} must be a number, got {value!r}")
    if not is_concrete(value):
        return
    values = np.asarray(value)
    shown = f" {unit}" if unit else ""
    wrong = ~np.isfinite(values) if finite else np.isnan(values)
    if wrong.any():
        raise ConfigurationError(f"{name} must be finite, got {values[wrong].flat[0]}{shown}")
    tests: tuple[tuple[float | None, str, Callable[[Any, Any], Any]], ...] = (
        (minimum, ">=", np.greater_equal),
        (above, ">", np.greater),
        (maximum, "<=", np.less_equal),
        (below, "<", np.less),
    )
    for bound, sign, holds in tests:
        if bound is not None:
            good = holds(values, bound)
            if not good.all():
                got = values[~good].flat[0]
                raise ConfigurationError(f"{name} must be {sign} {bound:g}{shown}, got {got:g}")
    if ndim is not None and values.size == 0:
        raise ConfigurationError(f"{name} must not be empty")


def check_static(
    name: str,
    value: Any,
    *,
    allowed: tuple[Any, ...] | None = None,
    minimum: int | None = None,
    flag: bool = False,
) -> None:
    """Raise ConfigurationError unless a static value is one of the allowed ones."""
    if flag and not isinstance(value, bool):
        raise ConfigurationError(f"{name} must be True or False, got {value!r}")
    if allowed is not None and value not in allowed:
        raise ConfigurationError(
            f"{name} must be one of the allowed values, got {value!r}; "
            + choices(value, [str(choice) for choice in allowed])
        )
    if minimum is not None and (
        isinstance(value, bool) or not isinstance(value, int | np.integer) or value < minimum
    ):
        raise ConfigurationError(f"{name} must be a whole number >= {minimum}, got {value!r}")


def snake_case(name: str) -> str:
    """Return a class name as it is written in scenarios and on the command line.

    Parameters
    ----------
    name
        In capitals and small letters.

    Examples
    --------
    >>> snake_case("CrossCoupled")
    'cross_coupled'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


T = TypeVar("T")


def configurable(value: object) -> tuple[str, ...]:
    """Return the names of the fields that ``replace`` may change.

    Parameters
    ----------
    value
        A configuration.
    """
    return tuple(f.name for f in dataclasses.fields(cast(Any, value)) if f.init)


def replace(configuration: T, **changes: Any) -> T:
    """Return a copy with some fields changed, converted and checked like a new one.

    Parameters
    ----------
    configuration
        A configuration.
    **changes
        New values by field name.

    Raises
    ------
    ConfigurationError
        A name that is not a field, or a value out of bounds.
    """
    for name in changes:
        if name not in configurable(configuration):
            raise ConfigurationError(
                f"{type(configuration).__name__} has no field {name!r}; "
                + choices(name, configurable(configuration))
            )
    return dataclasses.replace(cast(Any, configuration), **changes)  # type: ignore[no-any-return]


def replace_at(configuration: T, path: str, value: Any) -> T:
    """Return a copy with the field at a dotted path changed, checked at every level.

    Parameters
    ----------
    configuration
        A configuration, a tuple or a mapping of them.
    path
        Names (or positions in a tuple) joined by dots, such as ``"dynamics.friction.coulomb"``.
    value
        The new value.

    Raises
    ------
    ConfigurationError
        The path names nothing; the message lists what stands at that level.
    """
    head, _, rest = path.partition(".")
    if isinstance(configuration, tuple):
        if not head.isdigit() or int(head) >= len(configuration):
            positions = [str(position) for position in range(len(configuration))]
            raise ConfigurationError(f"no element {head!r}; " + choices(head, positions))
        items = list(configuration)
        items[int(head)] = replace_at(items[int(head)], rest, value) if rest else value
        return cast(T, tuple(items))
    if isinstance(configuration, Mapping):
        if head not in configuration:
            raise ConfigurationError(
                f"no entry {head!r}; " + choices(head, map(str, configuration))
            )
        entry = replace_at(configuration[head], rest, value) if rest else value
        return cast(T, {**configuration, head: entry})
    if not dataclasses.is_dataclass(configuration) or head not in configurable(configuration):
        names = configurable(configuration) if dataclasses.is_dataclass(configuration) else ()
        raise ConfigurationError(
            f"{type(configuration).__name__} has no field {head!r}; " + choices(head, names)
        )
    new = replace_at(getattr(configuration, head), rest, value) if rest else value
    return replace(configuration, **{head: new})


def _children(value: object) -> dict[str, Any]:
    if isinstance(value, tuple):
        return {str(k): item for k, item in enumerate(value)}
    if isinstance(value, Mapping):
        return {str(k): item for k, item in value.items()}
    if dataclasses.is_dataclass(value):
        return {name: getattr(value, name) for name in configurable(value)}
    return {}


def _descendants(value: object, name: str) -> list[str]:
    found = []
    for key, child in _children(value).items():
        if key == name:
            found.append(key)
        found += [f"{key}.{rest}" for rest in _descendants(child, name)]
    return found


def resolve(configuration: object, path: str) -> str:
    """Return the full dotted path of one that may leave levels out.

    A name that is not at its level is looked for further down, and must then be the only one.

    Parameters
    ----------
    configuration
        A configuration, a tuple or a mapping of them.
    path
        Names joined by dots, such as ``"machine.mass"`` for ``"machine.dynamics.mass"``.

    Raises
    ------
    ConfigurationError
        The path names nothing, or several things; the message lists them.

    Examples
    --------
    >>> resolve({"a": {"b": {"c": 1.0}}}, "a.c")
    'a.b.c'
    """
    head, _, rest = path.partition(".")
    children = _children(configuration)
    if head not in children:
        found = _descendants(configuration, head)
        if len(found) != 1:
            kind = type(configuration).__name__
            what = f"{kind} holds several {head!r}" if found else f"{kind} has no field {head!r}"
            raise ConfigurationError(f"{what}; {choices(head, found or children)}")
        prefix = found[0]
    else:
        prefix = head
    if not rest:
        return prefix
    value: Any = configuration
    for name in prefix.split("."):
        value = _children(value)[name]
    return f"{prefix}.{resolve(value, rest)}"
