"""Part files that are no programs: points and drawings, and what ``[part]`` may say of them."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any, Literal

import pydantic

from contourlab.contours.part import Part
from contourlab.errors import choices
from contourlab.scenarios.locate import Key
from contourlab.scenarios.quantities import Angle, Length, Section
from contourlab.scenarios.values import KeyedError, at

__all__ = ["FileKind", "file_kind", "options_of", "read_part_file"]

FileKind = Literal["program", "points", "dxf", "svg"]

_KINDS: dict[str, FileKind] = {
    ".csv": "points", ".tsv": "points", ".npy": "points", ".dxf": "dxf", ".svg": "svg",
}  # fmt: skip


class PointsOptions(Section):
    """``[part]`` with a file of points."""

    unit: str | None = None
    columns: list[int | str] | None = None
    spline: bool = False
    tolerance: Length | None = None
    degree: int = 3
    parametrisation: str = "centripetal"
    corner_angle: Angle | None = None
    closed: bool = False
    spacing: Length | None = None
    blend: Length | None = None
    delimiter: str | None = None
    decimal: str | None = None
    header: bool | None = None
    comment: str = "#"


class DrawingOptions(Section):
    """``[part]`` with a drawing."""

    unit: str | None = None
    layers: list[str] | None = None
    chain: int | None = None
    reverse: bool = False
    gap: Length | None = None
    blend: Length | None = None


def file_kind(file: str) -> FileKind:
    """Return what a part file holds, by the end of its name; a program unless it is another one.

    Parameters
    ----------
    file
        Its name.
    """
    return _KINDS.get(FilePath(file).suffix.lower(), "program")


def options_of(kind: FileKind) -> list[str]:
    """Return the keys that go with a kind of file, beside ``file`` and ``axes``.

    Parameters
    ----------
    kind
        Of the file.
    """
    if kind == "program":
        return []
    return sorted(_model(kind).model_fields)


def _model(kind: FileKind) -> type[Section]:
    return PointsOptions if kind == "points" else DrawingOptions


def read_part_file(
    kind: FileKind, file: FilePath, axes: tuple[str, ...], given: dict[str, Any]
) -> Part:
    """Return the part of a file of points or a drawing.

    Parameters
    ----------
    kind
        What it holds.
    file
        The file.
    axes
        Names of the coordinates.
    given
        The other entries of ``[part]``.

    Raises
    ------
    KeyedError
        An unknown key, or a wrong value.
    PartError
        The file is refused.
    """
    model = _model(kind)
    try:
        options = model.model_validate(given)
    except pydantic.ValidationError as error:
        first = error.errors(include_url=False)[0]
        key: Key = ("part", *first["loc"])
        if first["type"] == "extra_forbidden":
            name = first["loc"][0]
            said = choices(name, [*model.model_fields, "file", "axes"])
            raise KeyedError(key, f"unknown key with a {kind} file; {said}") from None
        if first["type"] == "value_error":
            raise KeyedError(key, str(first["ctx"]["error"])) from None
        message = first["msg"]
        raise KeyedError(
            key, f"{message[0].lower()}{message[1:]}, got {first['input']!r}"
        ) from None
    chosen = {name: getattr(options, name) for name in options.model_fields_set}
    with at("part"):
        return _read(kind, file, axes, {k: v for k, v in chosen.items() if v is not None})


def _read(kind: FileKind, file: FilePath, axes: tuple[str, ...], said: dict[str, Any]) -> Part:
    from contourlab.contours import read_dxf, read_points, read_svg

    if kind == "points":
        return read_points(file, axes=axes, **said)
    return (read_dxf if kind == "dxf" else read_svg)(file, axes=axes, **said)
