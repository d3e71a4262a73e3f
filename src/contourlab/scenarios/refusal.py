"""Pydantic's complaints about a TOML file as one sentence with file, line, key and choices."""

from __future__ import annotations

from typing import Any, NoReturn

import pydantic

from contourlab.errors import ScenarioError, UnitError, choices
from contourlab.scenarios.locate import Key, line_of

__all__ = ["allowed_keys", "dotted", "refuse"]


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
    error: pydantic.ValidationError, model: type[pydantic.BaseModel], text: str, name: str
) -> NoReturn:
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

    Raises
    ------
    ScenarioError
        Always.
    """
    first = error.errors(include_url=False)[0]
    key = tuple(first["loc"])
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
