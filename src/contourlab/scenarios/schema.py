"""The sections of a scenario file and what each may hold.

Quantities that are customarily written in more than one unit carry it: ``"3000 mm/min"``. Numbers
without a unit are gains, counts, ratios and values whose name holds the unit (``bandwidth_hz``).
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from contourlab.recordings.corners import CORNER_RADIUS
from contourlab.scenarios.machine_schema import AxisSection, MachineSection
from contourlab.scenarios.part_files import file_kind
from contourlab.scenarios.quantities import Angle, Length, Section, Time, Velocity

__all__ = [
    "AxisSection", "FeedSection", "MachineSection", "PartSection", "ScenarioSections",
    "VarySection",
]  # fmt: skip


class PartSection(BaseModel):
    """``[part]``: a file, or a formula with its fields.

    What goes with points and drawings alone is in :mod:`contourlab.scenarios.part_files`.
    """

    model_config = ConfigDict(extra="allow", strict=True, frozen=True)

    file: str | None = None
    formula: str | None = None
    axes: list[str] | None = None
    default_units: Literal["mm", "inch"] = "mm"
    block_delete: bool = False
    start: list[Any] | None = None
    """As written: of a program three lengths, of some formulas a field of their own."""
    lines: list[int] | None = None
    plane: Literal["XY", "ZX", "YZ"] | None = None
    skip_rapids: bool = False
    space: Literal["tool", "axes"] = "tool"
    """Whether a formula is the path of the tool, or of the axes of a machine with a tool map."""

    @model_validator(mode="after")
    def _one_of(self) -> PartSection:
        if (self.file is None) == (self.formula is None):
            raise ValueError(
                "give either file (a part program, points or a drawing) or formula (a contour by "
                "name)"
            )
        if self.file is not None and self.model_extra and file_kind(self.file) == "program":
            name = next(iter(self.model_extra))
            raise ValueError(
                f"unknown key {name!r}; with file the allowed keys are axes, block_delete, "
                "default_units, lines, plane, skip_rapids, start"
            )
        if self.lines is not None and not (
            len(self.lines) == 2 and 1 <= self.lines[0] <= self.lines[1]
        ):
            raise ValueError(
                f"lines must be the first and the last line, counted from 1, got {self.lines!r}"
            )
        if self.space == "axes" and self.file is not None:
            raise ValueError("space = 'axes' goes with formula: files are paths of the tool")
        if self.plane is not None and self.axes is not None:
            raise ValueError("plane gives the coordinates itself; remove axes")
        return self


class FeedSection(Section):
    """``[feed]``: how fast along the contour."""

    kind: Literal["programmed", "constant_rate", "constant_feed"] = "programmed"
    feed: Velocity | None = None
    rapid_feed: Velocity | None = None
    rate: float | None = None
    duration: Time | None = None
    corner_angle: Angle | None = None
    fastest: bool | None = None
    limits: Literal["common", "own"] | None = None

    @model_validator(mode="after")
    def _belongs(self) -> FeedSection:
        allowed = {
            "programmed": {"feed", "rapid_feed", "corner_angle", "fastest", "limits"},
            "constant_rate": {"rate", "duration"},
            "constant_feed": {"feed", "duration"},
        }[self.kind]
        required = {"constant_rate": {"rate", "duration"}, "constant_feed": {"feed"}}
        for name in type(self).model_fields:
            if name != "kind" and name not in allowed and getattr(self, name) is not None:
                raise ValueError(
                    f"{name} does not go with kind {self.kind!r}, which takes "
                    f"{', '.join(sorted(allowed))}"
                )
        for name in sorted(required.get(self.kind, ())):
            if getattr(self, name) is None:
                raise ValueError(f"kind {self.kind!r} needs {name}")
        return self


class SimulationSection(Section):
    """``[simulation]``."""

    sample_time: Time = Field(default=1e-3, gt=0)
    substeps: int | None = Field(default=None, ge=1)
    seed: int = Field(default=0, ge=0, lt=2**63)
    engine: Literal["jax", "c"] = "jax"
    disturbance: list[dict[str, Any]] = Field(default_factory=list)


class VarySection(BaseModel):
    """``[vary]``: paths and how their values are drawn; these stand in ``model_extra``."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True)

    samples: int | None = Field(default=None, ge=1, le=100_000)
    seed: int = Field(default=0, ge=0, lt=2**63)
    grid: bool = False


class ReportSection(Section):
    """``[report]``."""

    title: str = ""
    magnification: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    corner_radius: Length = Field(default=CORNER_RADIUS, gt=0)


class ScenarioSections(Section):
    """The whole file."""

    part: PartSection
    feed: FeedSection = FeedSection()
    machine: list[MachineSection] = Field(min_length=1)
    controller: list[dict[str, Any]] = Field(min_length=1)
    simulation: SimulationSection = SimulationSection()
    vary: VarySection | None = None
    report: ReportSection = ReportSection()
