"""From a TOML file to objects that are ready to run."""

from __future__ import annotations

import tomllib
from pathlib import Path as FilePath
from typing import Any

import pydantic

from contourlab.controllers.base import Controller
from contourlab.errors import ContourlabError, ScenarioError, TravelError
from contourlab.machines import Machine
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
from contourlab.scenarios.values import KeyedError
from contourlab.scenarios.vary import build_variation
from contourlab.simulation.checks import as_reference, check_loop
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
        return _build(sections, labels, said + text, name, folder)
    except pydantic.ValidationError as error:
        refuse(
            error, ScenarioSections, text, name, written=lambda key: _written(key, single=single)
        )
    except KeyedError as error:
        key = _written(error.key, single=single)
        raise ScenarioError(
            error.message, file=name, line=line_of(text, key), key=dotted(key)
        ) from error


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
    sections: ScenarioSections, labels: list[str], text: str, name: str, folder: FilePath
) -> Scenario:
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
    for k, (controller, own) in enumerate(controllers.items()):
        for label, law in own.items():
            _check(law, machines[label], as_reference(planned[label]), ("controller", k),
                   f"{controller} on machine {label}: " if len(machines) > 1 else "")  # fmt: skip
    loops = [
        Loop(
            label,
            controller,
            machines[label],
            own[label],
            as_reference(planned[label]),
            disturbances,
        )
        for label in machines
        for controller, own in controllers.items()
        if label in own
    ]
    seed = sections.simulation.seed
    return Scenario(
        setups={
            label: Setup(
                machine, {name: own[label] for name, own in controllers.items() if label in own},
                planned[label],
            )
            for label, machine in machines.items()
        },
        disturbances=disturbances, seed=seed, part=part, title=sections.report.title,
        magnification=sections.report.magnification, text=text, source=name,
        variation=build_variation(sections.vary, loops, seed) if sections.vary else None,
        corner_radius=sections.report.corner_radius,
        notes=(*restriction_notes(sections.part, part), *_limit_notes(sections)),
        common=sections.feed.limits != "own", engine=sections.simulation.engine,
    )  # fmt: skip


def _machine(
    section: MachineSection, number: int, substeps: int | None, folder: FilePath
) -> Machine:
    try:
        return build_machine(section, substeps, folder)
    except KeyedError as error:
        if error.key[:1] != ("machine",):
            raise
        raise KeyedError(("machine", number, *error.key[1:]), error.message) from error


def _check(law: Controller, machine: Machine, reference: Reference, key: Key, who: str) -> None:
    try:
        check_loop(machine, law, reference)
        law.bind(reference.contour, reference.sample_time)
    except TravelError as error:  # whatever the law: the part is in the wrong place
        raise KeyedError(("part",), f"{who}{error}") from error
    except ContourlabError as error:
        raise KeyedError(key, f"{who}{error}") from error


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
