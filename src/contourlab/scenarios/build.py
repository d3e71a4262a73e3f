"""From the sections of a scenario to objects: part, controllers, disturbances, reference."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from contourlab.configuration import replace
from contourlab.contours.base import Contour
from contourlab.contours.combined import CombinedAxes
from contourlab.contours.part import Part, axis_columns
from contourlab.controllers.base import Controller
from contourlab.errors import choices
from contourlab.feedrate import AxisLimits, Plan, constant_feed, constant_rate, plan_feed
from contourlab.feedrate.program import part_warnings
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.reference import Reference
from contourlab.scenarios import registry
from contourlab.scenarios.axes_path import reference_of_axes
from contourlab.scenarios.locate import Key
from contourlab.scenarios.own_law import is_own_law, law_name, load_own_law
from contourlab.scenarios.part_files import file_kind, read_part_file
from contourlab.scenarios.schema import FeedSection, PartSection
from contourlab.scenarios.values import KeyedError, KeyedRefusedError, at, make
from contourlab.units import parse_quantity

__all__ = [
    "build_contour", "build_controllers", "build_disturbance", "build_references",
    "restriction_notes",
]  # fmt: skip

_OF_FILES = (
    "axes", "block_delete", "default_units", "lines", "plane", "skip_rapids", "start",
)  # fmt: skip


def build_contour(
    section: PartSection, names: tuple[str, ...], folder: FilePath
) -> tuple[Contour, Part | None]:
    """Return the contour of a scenario, and the part if it comes from a file.

    Parameters
    ----------
    section
        ``[part]``.
    names
        Of the machine's axes.
    folder
        Where files are looked for.

    Raises
    ------
    KeyedError
        Something in it is wrong; says at which key.
    """
    if section.file is not None and (kind := file_kind(section.file)) != "program":
        for name in _OF_FILES:
            if name in section.model_fields_set and name != "axes":
                raise KeyedError(("part", name), f"goes with a part program, not with {kind}")
        axes = tuple(section.axes) if section.axes is not None else names
        part = read_part_file(kind, folder / section.file, axes, dict(section.model_extra or {}))
        return part.path, part
    if section.file is not None:
        from contourlab.contours.gcode import read_gcode

        start = (0.0, 0.0, 0.0) if section.start is None else _program_start(section.start)
        # moves out of a plane are there to be left out: all three are read
        whole = tuple("XYZ") if section.plane is not None else names
        axes = tuple(section.axes) if section.axes is not None else whole
        with at("part", "axes"):
            axis_columns(axes)
        with at("part"):
            part = read_gcode(
                folder / section.file, axes=axes, default_units=section.default_units,
                block_delete=section.block_delete, start=start,
            )  # fmt: skip
            part = _restricted(section, part, names)
        return part.path, part
    for name in _OF_FILES:
        if name in section.model_fields_set and name != "start":
            raise KeyedError(("part", name), "goes with file, not with formula")
    with at("part", "formula"):
        cls = registry.lookup("formula", section.formula, registry.contours())
    fields = dict(section.model_extra or {})
    if section.start is not None:  # of a line or an arc
        fields["start"] = section.start
    return make(cls, fields, ("part",)), None


def _program_start(values: list[Any]) -> tuple[float, ...]:
    if len(values) != 3:
        raise KeyedError(("part", "start"), f"needs X, Y and Z, got {len(values)} values")
    with at("part", "start"):
        return tuple(parse_quantity(value, "length", "start") for value in values)


def _restricted(section: PartSection, part: Part, names: tuple[str, ...]) -> Part:
    if section.lines is None and section.plane is None and not section.skip_rapids:
        return part
    lines = None if section.lines is None else (section.lines[0], section.lines[1])
    plane: str | None = section.plane
    if plane is not None and len(names) != 2:
        raise KeyedError(
            ("part", "plane"),
            f"leaves two coordinates, and the machine has {len(names)} axes, {', '.join(names)}",
        )
    if plane is not None and set(names) <= set("XYZ"):
        if set(names) != set(plane):
            raise KeyedError(
                ("part", "plane"), f"{plane} is not the plane of the machine's axes {names!r}"
            )
        plane = "".join(names)  # X Z for a machine that has them in that order
    return part.restricted(lines=lines, plane=plane, feed_only=section.skip_rapids)


def restriction_notes(section: PartSection, part: Part | None) -> tuple[tuple[str, str], ...]:
    """Return what a part was restricted to, for the report; empty if to nothing.

    Parameters
    ----------
    section
        ``[part]``.
    part
        As ``build_contour`` returned it.
    """
    if part is None:
        return ()
    said = []
    if section.lines is not None:
        said.append(f"lines {section.lines[0]} to {section.lines[1]} of {len(part.lines)}")
    if section.plane is not None:
        said.append(f"moves in the {section.plane} plane")
    if section.skip_rapids:
        said.append("without the rapids at both ends")
    return (("only a share of the part", "; ".join(said) + "; the rest is left out"),) * bool(said)


def build_controllers(
    entries: Sequence[Mapping[str, Any]], machines: Mapping[str, Machine],
    folder: FilePath = FilePath("."),
) -> dict[str, dict[str, Controller | KeyedRefusedError]]:  # fmt: skip
    """Return every controller for each machine that it runs on, by its name and the machine's.

    In place of a controller that a machine does not take stands why.

    Parameters
    ----------
    entries
        ``[[controller]]``.
    machines
        By name.
    folder
        Where a file with a law of the user's own is looked for.

    Raises
    ------
    KeyedError
        Something in them is wrong; says at which key, and with several machines on which.
    """
    made: dict[str, dict[str, Controller | KeyedRefusedError]] = {}
    for k, entry in enumerate(entries):
        key: Key = ("controller", k)
        values = dict(entry)
        name = values.pop("name", None)
        only = _only(values.pop("machines", None), (*key, "machines"), machines)
        own = {where: _on(where, values, key, machines, folder) for where in only}
        if name is None:
            name = law_name(str(values["type"]))
        if not isinstance(name, str) or not name:
            raise KeyedError((*key, "name"), f"must be a name, got {name!r}")
        if name in made:
            raise KeyedError(
                (*key, "name"), f"{name!r} stands already; give each controller a name of its own"
            )
        made[name] = own
    return made


def _only(value: Any, key: Key, machines: Mapping[str, Machine]) -> list[str]:
    if value is None:
        return list(machines)
    if not isinstance(value, list) or not value:
        raise KeyedError(key, f"must be a list of machines, got {value!r}")
    for name in value:
        if name not in machines:
            raise KeyedError(key, f"no machine {name!r}; {choices(name, machines)}")
    if len(set(value)) < len(value):
        raise KeyedError(key, f"names a machine twice: {value!r}")
    return [name for name in machines if name in value]


def _on(
    where: str, values: Mapping[str, Any], key: Key, machines: Mapping[str, Machine],
    folder: FilePath,
) -> Controller | KeyedRefusedError:  # fmt: skip
    try:
        return _controller(values, key, machines[where], folder)
    except KeyedRefusedError as refusal:
        return refusal
    except KeyedError as error:
        if len(machines) == 1:
            raise
        raise KeyedError(error.key, f"{error.message} (on machine {where})") from error


def _controller(value: Any, key: Key, machine: Machine, folder: FilePath) -> Controller:
    if isinstance(value, Mapping) and is_own_law(value.get("type")):
        values = dict(value)
        with at(*key, "type"):
            cls = load_own_law(values.pop("type"), folder)
    else:
        cls, values = _typed(value, key, "controller", registry.controllers())
    return make(  # type: ignore[no-any-return]
        cls, values, key, given=_given(cls, machine),
        parts={
            "axis": lambda v, k: _controller(v, k, machine, folder),
            "estimator": _estimator,
            "frame": _frame,
            "least_squares": _least_squares,
        },
    )  # fmt: skip


def _given(cls: type, machine: Machine) -> dict[str, Any]:
    names = {field.name for field in dataclasses.fields(cls)}
    if "model" not in names:
        return {}
    with at("machine"):
        return {"model": machine.nominal}


def _estimator(value: Any, key: Key) -> Any:
    value = {"type": value} if isinstance(value, str) else value
    cls, values = _typed(value, key, "estimator", registry.estimators())
    return make(cls, values, key)


def _frame(value: Any, key: Key) -> Any:
    value = {"type": value} if isinstance(value, str) else value
    cls, values = _typed(value, key, "frame", registry.frames())
    return make(cls, values, key)


def _least_squares(value: Any, key: Key) -> Any:
    from contourlab.controllers import FilteredLeastSquares

    if not isinstance(value, Mapping):
        raise KeyedError(key, f"must be a table of settings, got {value!r}")
    return make(FilteredLeastSquares, value, key)


def build_disturbance(value: Any, key: Key, names: tuple[str, ...]) -> Disturbance:
    """Return a disturbance of a scenario.

    Parameters
    ----------
    value
        The table.
    key
        Where it stands.
    names
        Of the machine's axes.

    Raises
    ------
    KeyedError
        Something in it is wrong; says at which key.
    """
    cls, values = _typed(value, key, "disturbance", registry.disturbances())
    axis = values.get("axis")
    if axis not in names:
        raise KeyedError((*key, "axis"), f"no axis {axis!r}; {choices(axis, names)}")
    values["axis"] = names.index(axis)
    return make(cls, values, key)  # type: ignore[no-any-return]


def _typed(value: Any, key: Key, kind: str, table: dict[str, type]) -> tuple[type, dict[str, Any]]:
    if not isinstance(value, Mapping) or "type" not in value:
        raise KeyedError(key, f"a {kind} needs type; {choices('', table)}")
    values = dict(value)
    with at(*key, "type"):
        return registry.lookup(kind, values.pop("type"), table), values


def build_references(
    feed: FeedSection, contour: Contour | Part, machines: Mapping[str, Machine], sample_time: float
) -> dict[str, Plan | Reference]:
    """Return the plan for each machine, by its name; a reference where nothing is planned.

    Parameters
    ----------
    feed
        ``[feed]``; whether each machine is planned by its own limits, or all by the tightest.
    contour
        What is followed.
    machines
        By name.
    sample_time
        Time between samples [s].

    Raises
    ------
    KeyedError
        A machine without limits, or a feed that cannot be planned.
    """
    if isinstance(contour, CombinedAxes) and feed.kind == "programmed":
        raise KeyedError(
            ("feed", "kind"),
            "'programmed' is planned by limits of the tool's coordinates, and the path is given in "
            "axes (part.space); give 'constant_rate' or 'constant_feed'",
        )
    if feed.kind != "programmed":
        with at("feed"):
            return dict.fromkeys(machines, _constant(feed, contour, sample_time))
    for k, machine in enumerate(machines.values()):
        if machine.limits is None:
            raise KeyedError(
                ("machine", k),
                "the machine has no axis limits, which the programmed feed needs",
            )
    limits = {name: machine.limits for name, machine in machines.items()}
    if feed.limits == "own":
        with at("feed"):
            return {name: _planned(feed, contour, own, sample_time) for name, own in limits.items()}
    n_axes = next(iter(machines.values())).n_axes
    with at("feed"):
        common = _tightest([own.for_axes(n_axes) for own in limits.values() if own is not None])
        return dict.fromkeys(machines, _planned(feed, contour, common, sample_time))


def _tightest(limits: Sequence[AxisLimits]) -> AxisLimits:
    if len(limits) == 1:
        return limits[0]
    return AxisLimits(
        **{
            name: np.min([np.asarray(getattr(own, name)) for own in limits], axis=0)
            for name in ("velocity", "acceleration", "jerk")
        }
    )


def _planned(
    feed: FeedSection, contour: Contour | Part, limits: AxisLimits | None, sample_time: float
) -> Plan:
    options = {
        name: getattr(feed, name)
        for name in ("feed", "rapid_feed", "corner_angle", "fastest")
        if getattr(feed, name) is not None
    }
    return plan_feed(contour, limits=limits, sample_time=sample_time, **options)


def _constant(feed: FeedSection, contour: Contour | Part, sample_time: float) -> Reference:
    curve = contour.path if isinstance(contour, Part) else contour
    if feed.kind == "constant_rate":
        assert feed.rate is not None
        assert feed.duration is not None
        reference = constant_rate(
            curve, rate=feed.rate, duration=feed.duration, sample_time=sample_time
        )
    else:
        assert feed.feed is not None
        reference = constant_feed(
            curve, feed=feed.feed, sample_time=sample_time, duration=feed.duration
        )
    if isinstance(curve, CombinedAxes):
        reference = reference_of_axes(curve, reference)
    if isinstance(contour, Part):
        unused = f"kind {feed.kind!r} does not use the program's feeds, rapids, dwells and stops"
        reference = replace(
            reference, warnings=(*part_warnings(contour), unused, *reference.warnings)
        )
    return reference
