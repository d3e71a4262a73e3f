"""From a TOML file to objects that are ready to run."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from typing import Any

import pydantic

from contourlab.controllers.base import Controller
from contourlab.errors import ContourlabError, ScenarioError, TravelError
from contourlab.feedrate import Plan
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.reference import Reference
from contourlab.scenarios.axes_path import in_axes
from contourlab.scenarios.build import (
    build_contour,
    build_controllers,
    build_disturbance,
    build_references,
    restriction_notes,
)
from contourlab.scenarios.locate import Key, line_of
from contourlab.scenarios.machine import build_machine
from contourlab.scenarios.part_files import file_kind, options_of
from contourlab.scenarios.refusal import dotted, refuse
from contourlab.scenarios.scenario import Scenario, Setup
from contourlab.scenarios.schema import MachineSection, PartSection, ScenarioSections
from contourlab.scenarios.values import KeyedError, KeyedRefusedError
from contourlab.scenarios.vary import absent_paths, build_variation
from contourlab.simulation.checks import as_reference, why_refused
from contourlab.simulation.pairing import ONLY, Loop

__all__ = ["read_scenario", "read_scenario_text"]

LARGEST_FILE = 1 << 20


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
        kept = _kept(raw["part"], str(part))
        raw["part"] = {**kept, "file": str(FilePath(part).absolute())}
        raw["part"].pop("formula", None)
    said = f"# part replaced on the command line by {part}\n" if part is not None else ""
    return _from_raw(raw, text, name, FilePath(folder), said)


def _kept(section: dict[str, Any], part: str) -> dict[str, Any]:
    """Return what stays of ``[part]`` when another file takes its place: what its kind takes."""
    before = file_kind(section["file"]) if isinstance(section.get("file"), str) else "program"
    after = file_kind(part)
    allowed = {*PartSection.model_fields} if after == "program" else {"axes"}
    if before == after:
        allowed |= {*options_of(after)}
    return {k: v for k, v in section.items() if k in allowed}


def _from_raw(
    raw: dict[str, Any], text: str, name: str, folder: FilePath, said: str = ""
) -> Scenario:
    single, labels = _machine_list(raw, text, name)
    try:
        sections = ScenarioSections.model_validate(raw)
        return _build(
            sections, labels, said + text, name, folder,
            lambda error: _placed(error, text, name, single=single),
        )  # fmt: skip
    except pydantic.ValidationError as error:
        refuse(
            error, ScenarioSections, text, name, written=lambda key: _written(key, single=single)
        )
    except KeyedError as error:
        raise _placed(error, text, name, single=single) from error


def _placed(error: KeyedError, text: str, name: str, *, single: bool) -> ScenarioError:
    """Return an error at a key as one that says file and line."""
    key = _written(error.key, single=single)
    return ScenarioError(error.message, file=name, line=line_of(text, key), key=dotted(key))


def _machine_list(raw: dict[str, Any], text: str, file: str) -> tuple[bool, list[str]]:
    """Make ``[machine]`` a list of one, take the labels out, and return them.

    Returns whether there was one table, and what each machine is called.
    """
    given = raw.get("machine")
    single = isinstance(given, dict)
    tables = [given] if single else given
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        return False, []  # refused by the schema
    raw["machine"] = [{k: v for k, v in table.items() if k != "label"} for table in tables]
    labels: list[str] = []
    for k, table in enumerate(tables):
        key = _written(("machine", k, "label"), single=single)
        label = table.get("label", table.get("name", ONLY))
        wrong = ""
        if not isinstance(label, str) or not label.strip():
            wrong = f"must be a name, got {label!r}"
        elif label in labels:
            wrong = f"{label!r} stands already; give each machine a label of its own"
        if wrong and ("label" in table or isinstance(label, str)):
            raise ScenarioError(wrong, file=file, line=line_of(text, key), key=dotted(key))
        labels.append(str(label))
    return single, labels


def _build(
    sections: ScenarioSections, labels: list[str], text: str, name: str, folder: FilePath,
    placed: Callable[[KeyedError], ScenarioError],
) -> Scenario:  # fmt: skip
    machines = {
        label: _machine(section, k, sections.simulation.substeps, folder)
        for k, (label, section) in enumerate(zip(labels, sections.machine, strict=True))
    }
    axes = next(iter(machines.values())).names
    for k, (label, machine) in enumerate(machines.items()):
        if machine.names != axes:
            raise KeyedError(
                ("machine", k),
                f"machine {label} has axes {', '.join(machine.names)} and {labels[0]} has "
                f"{', '.join(axes)}: the machines of a scenario need the same axes",
            )
    contour, part = build_contour(sections.part, axes, folder)
    contour = in_axes(sections.part, contour, machines)
    controllers = build_controllers(sections.controller, machines, folder)
    for k, label in enumerate(labels):
        if not any(label in own for own in controllers.values()):
            raise KeyedError(("machine", k), f"no controller runs on machine {label}")
    disturbances = tuple(
        build_disturbance(entry, ("simulation", "disturbance", k), axes)
        for k, entry in enumerate(sections.simulation.disturbance)
    )
    planned = build_references(
        sections.feed, part or contour, machines, sections.simulation.sample_time
    )
    loops, refused = _loops(controllers, machines, planned, disturbances)
    seed, names = sections.simulation.seed, list(controllers)
    absent = absent_paths(sections.vary, loops, labels, names) if sections.vary else ()
    return Scenario(
        setups={
            label: Setup(
                machine,
                {one.controller_name: one.controller for one in loops if one.machine_name == label},
                planned[label],
                {who: placed(e) for (where, who), e in refused.items() if where == label},
            )
            for label, machine in machines.items()
        },
        disturbances=disturbances, seed=seed, part=part, title=sections.report.title,
        magnification=sections.report.magnification, text=text, source=name,
        variation=build_variation(sections.vary, loops, seed, labels, names, absent)
        if sections.vary else None,
        corner_radius=sections.report.corner_radius,
        notes=(
            *restriction_notes(sections.part, part), *_limit_notes(sections),
            *([("vary", f"{', '.join(absent)}: left out, as no law that runs has it")]
              if absent else ()),
        ),
        common=sections.feed.limits != "own", engine=sections.simulation.engine,
        names=tuple(names),
    )  # fmt: skip


def _loops(
    controllers: Mapping[str, Mapping[str, Controller | KeyedRefusedError]],
    machines: Mapping[str, Machine], planned: Mapping[str, Plan | Reference],
    disturbances: tuple[Disturbance, ...],
) -> tuple[list[Loop], dict[tuple[str, str], KeyedError]]:  # fmt: skip
    """Return what can run, and why the rest cannot, by machine and controller.

    Raises
    ------
    KeyedError
        Nothing can run, or a value is wrong wherever a law runs.
    """
    loops: list[Loop] = []
    refused: dict[tuple[str, str], KeyedError] = {}
    for label, machine in machines.items():
        reference = as_reference(planned[label])
        for k, (controller, own) in enumerate(controllers.items()):
            law = own.get(label)
            if isinstance(law, Controller):
                who = f"{controller} on machine {label}: " if len(machines) > 1 else ""
                refusal = _refusal(law, machine, reference, ("controller", k), who)
                loop = Loop(label, controller, machine, law, reference, disturbances)
                loops += [] if refusal else [loop]
            else:
                refusal = law
            if refusal is not None:
                refused[label, controller] = refusal
    if not loops:
        (label, controller), first = next(iter(refused.items()))
        who = f"{controller} on machine {label}: " if len(machines) > 1 else ""
        raise type(first)(first.key, f"{who}{first.message}")
    return loops, refused


def _machine(
    section: MachineSection, number: int, substeps: int | None, folder: FilePath
) -> Machine:
    try:
        return build_machine(section, substeps, folder)
    except KeyedError as error:
        if error.key[:1] != ("machine",):
            raise
        raise KeyedError(("machine", number, *error.key[1:]), error.message) from error


def _refusal(
    law: Controller, machine: Machine, reference: Reference, key: Key, who: str
) -> KeyedRefusedError | None:
    try:
        error = why_refused(machine, law, reference)
    except ContourlabError as mistake:
        raise KeyedError(key, f"{who}{mistake}") from mistake
    if error is None:
        return None
    # the travel does not ask for the law: the part is in the wrong place
    return KeyedRefusedError(("part",) if isinstance(error, TravelError) else key, str(error))


def _limit_notes(sections: ScenarioSections) -> tuple[tuple[str, str], ...]:
    if len(sections.machine) == 1 or sections.feed.kind != "programmed":
        return ()
    if sections.feed.limits == "own":
        said = (
            "each machine was planned by its own axis limits: the motions differ, and so do times "
            "and errors for that reason alone"
        )
    else:
        said = "all machines follow the same motion, planned by the tightest limit of each axis"
    return (("axis limits", said),)


def _written(key: Key, *, single: bool) -> Key:
    """Return a key as it stands in the file, where one machine is a table and no list."""
    if single and key[:1] == ("machine",) and len(key) > 1 and isinstance(key[1], int):
        return (key[0], *key[2:])
    return key
