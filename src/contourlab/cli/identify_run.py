"""``identify`` from recordings to tables and files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from contourlab.errors import ConfigurationError, RecordingError, choices
from contourlab.identification import (
    FrequencyModel,
    FrequencyResponse,
    Health,
    MachineIdentification,
    exciting_motion,
    fit_frequency_response,
    frequency_response,
    identified_machine,
    identify_machine,
    identify_position_loops,
    is_sweep,
    track_health,
)
from contourlab.recordings import Recording
from contourlab.reports import (
    identification_json,
    identification_table,
    write_identification_report,
)

__all__ = ["Identified", "identify_records", "refuse_unknown"]

ANSWERS = ("auto", "yes", "no")
Read = tuple[Recording, tuple[str, ...], tuple[str, ...]]
SUGGESTED_TIME = 10.0
"""Of the motion that is suggested [s]."""


def refuse_unknown(name: str, value: str) -> None:
    """Raise ConfigurationError unless a value is auto, yes or no.

    Parameters
    ----------
    name
        Of the option.
    value
        As the user wrote it.
    """
    if value not in ANSWERS:
        raise ConfigurationError(f"{name} must be auto, yes or no; {choices(value, ANSWERS)}")


@dataclass(kw_only=True)
class Identified:
    """What was found, and what to say of it."""

    found: MachineIdentification | None = None
    responses: tuple[FrequencyResponse, ...] = ()
    models: tuple[FrequencyModel, ...] = ()
    health: Health | None = None
    warnings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def write(
        self, output: Path | None, report: Path | None, suggest: Path | None, *, force: bool
    ) -> None:
        """Write machine file, page and suggested motion.

        Parameters
        ----------
        output, report, suggest
            Where; not written if None.
        force
            Whether existing files may be replaced.
        """
        from contourlab.scenarios.machine_file import machine_to_toml, write_machine_file

        machine = None
        if self.found is not None:
            try:
                machine = identified_machine(self.found, models=self.models)
            except RecordingError as error:
                if output is not None:
                    raise
                self.notes.append(f"No machine: {error}")
        if output is not None:
            if machine is None:
                raise RecordingError("nothing was found that makes a machine")
            write_machine_file(machine, output, overwrite=force)
        if suggest is not None:
            self._suggest(suggest, force=force)
        if report is not None:
            write_identification_report(
                self.found, report, responses=self.responses, models=self.models,
                health=self.health, machine="" if machine is None else machine_to_toml(machine),
                notes=tuple(self.notes), warnings=tuple(self.warnings), force=force,
            )  # fmt: skip

    def _suggest(self, file: Path, *, force: bool) -> None:
        if self.found is None:
            raise RecordingError("no motion is suggested: the log says nothing of what axes reach")
        axes = self.found.axes
        moves = [k for k, axis in enumerate(axes) if axis.speed > 0.0]
        if not moves:
            raise RecordingError("no motion is suggested: no axis moves in the log")
        most = {
            name: [max(getattr(a, name), 1e-3 * max(getattr(b, name) for b in axes)) for a in axes]
            for name in ("speed", "acceleration")
        }
        stroke = np.ptp(self.found.travel, axis=1)
        motion = exciting_motion(
            [axis.axis for axis in axes],
            stroke=np.maximum(stroke, 1e-3 * stroke.max()), middle=self.found.travel.mean(axis=1),
            duration=SUGGESTED_TIME, sample_time=self.found.sample_time, **most,
        )  # fmt: skip
        motion.to_csv(file, force=force)

    def json(
        self, output: Path | None, report: Path | None, suggest: Path | None
    ) -> dict[str, Any]:
        """Return the body of ``--json``.

        Parameters
        ----------
        output, report, suggest
            Files that were written.
        """
        return identification_json(
            self.found, responses=self.responses, models=self.models, health=self.health,
            machine=output, report=report, suggestion=suggest, warnings=tuple(self.warnings),
        )  # fmt: skip

    def show(self) -> None:
        """Print tables for people."""
        from rich.console import Console

        console = Console()
        if self.health is not None:
            console.print(str(self.health), markup=False, highlight=False)
        if self.found is not None:
            console.print(identification_table(self.found))
        for model in self.models:
            what = f"axis {model.axis}: {model.model.replace('_', ' ')}, misfit {model.misfit:.2g}"
            if model.model == "two_mass":
                what += f", measured on the {model.side}"
            console.print(what, markup=False, highlight=False)
            for name, one in (model.parameters | model.derived).items():
                ends = f" ({one.low:.5g} to {one.high:.5g})" if one.identified else ""
                value = f"{one.value:.5g}{ends} {one.unit}" if one.identified else "not told"
                console.print(f"  {name} {value}", markup=False, highlight=False)
        for note in [*self.notes, *(self.found.notes if self.found is not None else ())]:
            console.print(f"note: {note}", markup=False, highlight=False, style="dim")


def _machine(
    one: Recording, window: tuple[float, float] | None, source: str, options: dict[str, Any]
) -> MachineIdentification:
    """Return position loops of a log that has no more than these, and else the machine."""
    positions = one["command"].attrs.get("kind") == "position"
    if not positions or options["stiffness"] is not None or options["drive_lag"]:
        return identify_machine(one, window=window, source=source, **options)
    return identify_position_loops(one, window=window, source=source, **_of_loops(options))


def _of_loops(options: dict[str, Any]) -> dict[str, Any]:
    return {name: options[name] for name in ("known", "confidence")}


def _labels(sources: Sequence[str]) -> list[str]:
    """Return names of files, with as much of their folders as tells them apart."""
    parts = [Path(source).absolute().parts for source in sources]
    for n in range(1, max(map(len, parts))):
        names = ["/".join(one[-n:]) for one in parts]
        if len(set(names)) == len(set(parts)):
            return names
    return list(sources)


def identify_records(
    read: Sequence[Read], sources: Sequence[str], options: dict[str, Any], *,
    window: tuple[float, float] | None, track: float | None, sweep: str, rate: float,
    baseline: int | None = None,
) -> Identified:  # fmt: skip
    """Return what recordings say of their machine.

    Parameters
    ----------
    read
        Recording, warnings and notes of every log.
    sources
        Their names.
    options
        Of ``identify_machine``.
    window
        Start and end [s].
    track
        Window of one long record [s].
    sweep
        Whether the record is a sweep: auto, yes or no.
    rate
        Chance of any false alarm.
    baseline
        Records that the others are compared with.
    """
    result = Identified()
    for (_, warnings, notes), source in zip(read, sources, strict=True):
        which = f"{source}: " if len(read) > 1 else ""
        result.warnings += [which + text for text in warnings]
        result.notes += [which + text for text in notes]
    recordings = [one[0] for one in read]
    several = len(recordings) > 1
    if several and (track is not None or window is not None):
        raise ConfigurationError("track and window go with one log")
    if several or track is not None:
        if all(one["command"].attrs.get("kind") == "position" for one in recordings):
            if options["stiffness"] is not None or options["drive_lag"]:
                raise ConfigurationError(
                    "--spring and --drive-lag go with one log of positions, not with several or "
                    "with --track"
                )
            options = _of_loops(options)
        result.health = track_health(
            recordings if several else recordings[0],
            labels=_labels(sources) if several else None,
            window=track, rate=rate, options=options, n_baseline=baseline,
        )  # fmt: skip
        result.warnings += [str(change) for change in result.health.changes]
        result.notes += result.health.notes
        last = next((r for r in reversed(result.health.records) if r is not None), None)
        result.found = last
        return result
    one = recordings[0]
    swept = sweep == "yes"
    if sweep == "auto":
        command = np.asarray(one["command"], float)
        dt = float(np.asarray(one["time"], float)[1] - np.asarray(one["time"], float)[0])
        swept = any(is_sweep(column, dt) for column in command.T)
    failed: RecordingError | None = None
    if swept:
        result.responses = frequency_response(one, window=window)
        models = []
        for response in result.responses:
            try:
                models.append(fit_frequency_response(response, confidence=options["confidence"]))
            except RecordingError as error:
                result.warnings.append(str(error))
        result.models = tuple(models)
    try:
        result.found = _machine(one, window, sources[0], options)
        result.warnings += result.found.warnings
    except RecordingError as error:
        failed = error
    if failed is not None:
        if not swept:
            raise failed
        result.warnings.append(f"beside the frequency response nothing was found: {failed}")
    return result
