"""Mistakes in a TOML file as one sentence with file, line, key and choices."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NoReturn, TypeVar

import pydantic

from contourlab.errors import ConfigurationError, ScenarioError, UnitError, choices
from contourlab.scenarios.locate import Key, line_of
from contourlab.scenarios.values import KeyedError

__all__ = ["allowed_keys", "dotted", "inner", "located", "refuse"]

Row = TypeVar("Row", bound=pydantic.BaseModel)
Built = TypeVar("Built")


def inner(table: Any, path: Key) -> Any:
    """Return what stands at a path inside a table, None if nothing does.

    Parameters
    ----------
    table
        Checked by pydantic.
    path
        Names and positions.
    """
    for item in path:
        if isinstance(item, int):
            table = table[item] if item < len(table) else None
        else:
            table = getattr(table, item)
        if table is None:
            return None
    return table


def located(
    axes: Sequence[Row], build: Callable[[Sequence[Row]], Built], *path: str | int
) -> Built:
    """Return what is built of all axes, and say which axis it is that cannot be built.

    A part holds the values of all axes, so that its complaint names the field and no axis. The axis
    is the one whose values are refused when they stand alone.

    Parameters
    ----------
    axes
        ``[[machine.axis]]``.
    build
        From some axes to the part.
    *path
        Where in each axis the values stand.

    Raises
    ------
    KeyedError
        The values of one axis are refused; says at which key.
    ConfigurationError
        The axes are refused together only.
    """
    try:
        return build(axes)
    except ConfigurationError:
        for k, axis in enumerate(axes):
            try:
                build([axis])
            except ConfigurationError as error:
                message = str(error).removeprefix("axis 0: ")
                key = ("machine", "axis", k, *path, *_field(inner(axis, path), message))
                raise KeyedError(key, message) from error
        raise


def _field(table: Any, message: str) -> Key:
    """The key, given in a table, with whose name a message begins; some keys end in their unit."""
    given = table.model_fields_set if isinstance(table, pydantic.BaseModel) else set()
    word = message.split(" ", 1)[0]
    for name in (word, f"{word}_limit"):
        if name in given:
            return (name,)
    longer = [name for name in given if name.startswith(f"{word}_")]
    return (longer[0],) if len(longer) == 1 else ()


def dotted(key: Key) -> str:
    """Return a key as people write it, such as ``axis[0].mass``.

    Parameters
    ----------
    key
        Names and positions.
    """
    text = ""
    for item in key:
        text += f"[{item}]" if isinstance(item, int) else f".{item}" if text else str(item)
    return text


def refuse(
    error: pydantic.ValidationError, model: type[pydantic.BaseModel], text: str, name: str,
    written: Callable[[Key], Key] | None = None,
) -> NoReturn:  # fmt: skip
    """Raise a ScenarioError that says the first mistake.

    Parameters
    ----------
    error
        Of pydantic.
    model
        What the file was checked against.
    text
        The file's text.
    name
        What to call the file.
    written
        From the key of what was checked to that in the file, where they differ.

    Raises
    ------
    ScenarioError
        Always.
    """
    first = error.errors(include_url=False)[0]
    key = tuple(first["loc"])
    if written is not None:
        key = written(key)
    kind, message = first["type"], first["msg"]
    if kind == "extra_forbidden":
        message = f"unknown key; {choices(key[-1], allowed_keys(model, key))}"
    elif kind == "missing":
        message = "is missing"
    elif kind == "value_error":
        cause = first.get("ctx", {}).get("error")
        message = str(cause)
        if isinstance(cause, UnitError):
            message = message.removeprefix("value must be").removeprefix("value = ").strip()
            message = message if message.startswith(("'", '"')) else f"must be {message}"
    else:
        message = f"{message[0].lower()}{message[1:]}, got {first['input']!r}"
    more = error.error_count() - 1
    if more:
        message += f" (and {more} more mistake{'s' if more > 1 else ''})"
    raise ScenarioError(message, file=name, line=line_of(text, key), key=dotted(key)) from error


def allowed_keys(model: Any, key: Key) -> list[str]:
    """Return the keys that may stand beside one.

    Parameters
    ----------
    model
        Of the whole file.
    key
        Names and positions.
    """
    for item in key[:-1]:
        if isinstance(item, int):
            continue
        field = model.model_fields.get(item)
        if field is None:
            return []
        annotation = field.annotation
        for candidate in (annotation, *getattr(annotation, "__args__", ())):
            inner = (candidate, *getattr(candidate, "__args__", ()))
            found = [c for c in inner if isinstance(c, type) and issubclass(c, pydantic.BaseModel)]
            if found:
                model = found[0]
                break
    return list(model.model_fields)
