"""The part that a log is judged against, in the coordinates of the log."""

from __future__ import annotations

import os
from pathlib import Path as FilePath

from contourlab.contours import read_dxf, read_gcode, read_points, read_svg
from contourlab.contours.part import Part
from contourlab.errors import LogError, PartError

__all__ = ["read_part"]


def read_part(file: str | os.PathLike[str], axes: tuple[str, ...]) -> Part:
    """Return the part of a file: a program, points or a drawing, by the end of its name.

    Parameters
    ----------
    file
        The file.
    axes
        Axes of the log: the coordinates of the part are the same ones. Of a program that moves in
        a third one, what moves along it is left out.

    Raises
    ------
    PartError
        The file cannot be read, or has no such coordinates.
    LogError
        The axes of the log are none of a part's.
    """
    ending = FilePath(os.fspath(file)).suffix.lower()
    names = tuple(axis.upper() for axis in axes)
    if ending in (".csv", ".tsv", ".npy"):
        return read_points(file, axes=names)
    if not set(names) <= set("XYZ"):
        raise LogError(
            f"the part has coordinates X, Y, Z and the log axes {', '.join(axes)}: name them with "
            "axes"
        )
    if ending == ".dxf":
        return read_dxf(file, axes=names)
    if ending == ".svg":
        return read_svg(file, axes=names)
    try:
        return read_gcode(file, axes=names)
    except PartError:
        if len(names) != 2:
            raise
        whole = read_gcode(file, axes=tuple("XYZ"))
        return whole.restricted(plane="".join(names))
