"""From a TOML file to objects that are ready to run."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, NoReturn

import pydantic

from contourlab.configuration import replace
from contourlab.contours.base import Contour
from contourlab.contours.part import Part, axis_columns
from contourlab.controllers.base import Controller
from contourlab.errors import ScenarioError, TravelError, UnitError, choices
from contourlab.feedrate import constant_feed, constant_rate, plan_feed
from contourlab.feedrate.program import part_warnings
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.reference import Reference
from contourlab.scenarios import registry
from contourlab.scenarios.locate import Key, line_of
from contourlab.scenarios.machine import build_machine
from contourlab.scenarios.schema import FeedSection, PartSection, ScenarioSections
from contourlab.scenarios.values import KeyedError, at, make
from contourlab.simulation.checks import check_loop
from contourlab.simulation.comparison import Comparison, compare

__all__ = ["Scenario", "read_scenario", "read_scenario_text"]

LARGEST_FILE = 1 << 20


@dataclass(frozen=True)
class Scenario:
    """A scenario as objects: everything that a run or a comparison needs."""

    machine: Machine
    controllers: Mapping[str, Controller]
    reference: Reference
    disturbances: tuple[Disturbance, ...]
    seed: int
    part: Part | None
    """The part program, if the contour came from one."""
    stops: tuple[float, ...]
    """Times of exact stops [s]."""
    title: str
    magnification: float | None
    text: str
    """The file's text."""
    source: str
    """Its name as given."""

    def compare(self, progress: Any = None) -> Comparison:
        """Run every controller of the scenario.

        Parameters
        ----------
        progress
            As for :func:`contourlab.compare`.
        """
        return compare(
            self.machine, self.controllers, self.reference, disturbances=self.disturbances,
            seed=self.seed, part=self.part, stops=self.stops, scenario=self.text,
            title=self.title, progress=progress,
        )  # fmt: skip


def read_scenario(file: str | FilePath, *, part: str | FilePath | None = None) -> Scenario:
    """Return the scenario of a TOML file.

    Parameters
    ----------
    file
        The scenario.
    part
        A part program that takes the place of the one the scenario names.

    Returns
    -------
    Scenario
        Everything read, planned and checked; nothing has run.

    Raises
    ------
    ScenarioError
        The file cannot be read, or something in it is wrong: file, line, key, value and choices.
    ContourlabError
        The part cannot be read, planned or reached by the machine.
    """
    path = FilePath(file)
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ScenarioError(f"larger than {LARGEST_FILE} bytes", file=str(file))
        data = path.read_bytes()
    except OSError as error:
        raise ScenarioError(f"cannot be read ({error.strerror})", file=str(file)) from error
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ScenarioError("not a text in UTF-8", file=str(file), line=line) from error
    return read_scenario_text(text, name=str(file), folder=path.parent, part=part)


def read_scenario_text(
    text: str,
    *,
    name: str = "scenario",
    folder: str | FilePath = ".",
    part: str | FilePath | None = None,
) -> Scenario:
    """Return the scenario of a TOML text.

    Parameters
    ----------
    text
        The scenario.
    name
        What to call it in messages.
    folder
        Where the files that it names are looked for.
    part
        A part program that takes the place of the one the scenario names.

    Raises
    ------
    ScenarioError, ContourlabError
        As ``read_scenario``.
    """
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"not valid TOML: {error}", file=name) from error
    except RecursionError:
        raise ScenarioError("not valid TOML: nested too deeply", file=name) from None
    if part is not None and isinstance(raw.get("part"), dict):
        kept = {k: v for k, v in raw["part"].items() if k in PartSection.model_fields}
        raw["part"] = {**kept, "file": str(FilePath(part).absolute())}
        raw["part"].pop("formula", None)
    try:
        sections = ScenarioSections.model_validate(raw)
        said = f"# part replaced on the command line by {part}\n" if part is not None else ""
        return _build(sections, said + text, name, FilePath(folder))
    except pydantic.ValidationError as error:
        _refuse(error, raw, text, name)
    except KeyedError as error:
        raise ScenarioError(
            error.message, file=name, line=line_of(text, error.key), key=_dotted(error.key)
        ) from error


def _build(sections: ScenarioSections, text: str, name: str, folder: FilePath) -> Scenario:
    machine = build_machine(sections.machine, sections.simulation.substeps)
    contour, part = _contour(sections.part, machine, folder)
    controllers = _controllers(sections.controller, machine)
    disturbances = tuple(
        _disturbance(entry, ("simulation", "disturbance", k), machine)
        for k, entry in enumerate(sections.simulation.disturbance)
    )
    with at("feed"):
        reference, stops = _reference(
            sections.feed, part or contour, machine, sections.simulation.sample_time
        )
    for k, controller in enumerate(controllers.values()):
        with at("controller", k):
            try:
                check_loop(machine, controller, reference)
            except TravelError as error:  # whatever the law: the part is in the wrong place
                raise KeyedError(("part",), str(error)) from error
            controller.bind(reference.contour, reference.sample_time)
    return Scenario(
        machine, controllers, reference, disturbances, sections.simulation.seed, part, stops,
        sections.report.title, sections.report.magnification, text, name,
    )  # fmt: skip


def _contour(
    section: PartSection, machine: Machine, folder: FilePath
) -> tuple[Contour, Part | None]:
    if section.file is not None:
        from contourlab.contours.gcode import read_gcode

        start = tuple(section.start) if section.start is not None else (0.0, 0.0, 0.0)
        if len(start) != 3:
            raise KeyedError(("part", "start"), f"needs X, Y and Z, got {len(start)} values")
        axes = tuple(section.axes) if section.axes is not None else machine.names
        with at("part", "axes"):
            axis_columns(axes)
        with at("part"):
            part = read_gcode(
                folder / section.file, axes=axes, default_units=section.default_units,
                block_delete=section.block_delete, start=start,
            )  # fmt: skip
        return part.path, part
    for name in ("axes", "block_delete", "default_units", "start"):
        if name in section.model_fields_set:
            raise KeyedError(("part", name), "goes with file, not with formula")
    with at("part", "formula"):
        cls = registry.lookup("formula", section.formula, registry.contours())
    return make(cls, section.model_extra or {}, ("part",)), None


def _controllers(entries: list[dict[str, Any]], machine: Machine) -> dict[str, Controller]:
    made: dict[str, Controller] = {}
    for k, entry in enumerate(entries):
        key: Key = ("controller", k)
        values = dict(entry)
        name = values.pop("name", None)
        controller = _controller(values, key, machine)
        if name is None:
            name = str(values["type"]).replace("-", "_")
        if not isinstance(name, str) or not name:
            raise KeyedError((*key, "name"), f"must be a name, got {name!r}")
        if name in made:
            raise KeyedError(
                (*key, "name"), f"{name!r} stands already; give each controller a name of its own"
            )
        made[name] = controller
    return made


def _controller(value: Any, key: Key, machine: Machine) -> Controller:
    cls, values = _typed(value, key, "controller", registry.controllers())
    return make(  # type: ignore[no-any-return]
        cls, values, key, given=_given(cls, machine),
        parts={
            "axis": lambda v, k: _controller(v, k, machine),
            "estimator": _estimator,
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


def _disturbance(value: Any, key: Key, machine: Machine) -> Disturbance:
    cls, values = _typed(value, key, "disturbance", registry.disturbances())
    axis = values.get("axis")
    if axis not in machine.names:
        raise KeyedError((*key, "axis"), f"no axis {axis!r}; {choices(axis, machine.names)}")
    values["axis"] = machine.names.index(axis)
    return make(cls, values, key)  # type: ignore[no-any-return]


def _typed(value: Any, key: Key, kind: str, table: dict[str, type]) -> tuple[type, dict[str, Any]]:
    if not isinstance(value, Mapping) or "type" not in value:
        raise KeyedError(key, f"a {kind} needs type; {choices('', table)}")
    values = dict(value)
    with at(*key, "type"):
        return registry.lookup(kind, values.pop("type"), table), values


def _reference(
    feed: FeedSection, contour: Contour | Part, machine: Machine, sample_time: float
) -> tuple[Reference, tuple[float, ...]]:
    if feed.kind == "programmed":
        options = {
            name: getattr(feed, name)
            for name in ("feed", "rapid_feed", "corner_angle")
            if getattr(feed, name) is not None
        }
        if machine.limits is None:
            raise KeyedError(
                ("machine",), "the machine has no axis limits, which the programmed feed needs"
            )
        plan = plan_feed(contour, limits=machine.limits, sample_time=sample_time, **options)
        return plan.reference, tuple(float(t) for t in plan.stop_times)
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
    if isinstance(contour, Part):
        unused = f"kind {feed.kind!r} does not use the program's feeds, rapids, dwells and stops"
        reference = replace(
            reference, warnings=(*part_warnings(contour), unused, *reference.warnings)
        )
    return reference, ()


def _dotted(key: Key) -> str:
    text = ""
    for item in key:
        text += f"[{item}]" if isinstance(item, int) else f".{item}" if text else str(item)
    return text


def _refuse(error: pydantic.ValidationError, raw: Any, text: str, name: str) -> NoReturn:
    first = error.errors(include_url=False)[0]
    key = tuple(first["loc"])
    kind, message = first["type"], first["msg"]
    if kind == "extra_forbidden":
        message = f"unknown key; {choices(key[-1], _allowed(key))}"
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
    raise ScenarioError(message, file=name, line=line_of(text, key), key=_dotted(key)) from error


def _allowed(key: Key) -> list[str]:
    """Return the keys that may stand beside an unknown one."""
    model: Any = ScenarioSections
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
