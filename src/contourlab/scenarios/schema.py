"""The sections of a scenario file and what each may hold.

Quantities that are customarily written in more than one unit carry it: ``"3000 mm/min"``. Numbers
without a unit are gains, counts, ratios and values whose name holds the unit (``bandwidth_hz``).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from contourlab.units import parse_quantity

__all__ = ["AxisSection", "FeedSection", "MachineSection", "PartSection", "ScenarioSections"]


def _quantity(dimension: str) -> Any:
    return BeforeValidator(lambda value: parse_quantity(value, dimension))


Length = Annotated[float, _quantity("length")]
Time = Annotated[float, _quantity("time")]
Velocity = Annotated[float, _quantity("velocity")]
Acceleration = Annotated[float, _quantity("acceleration")]
Jerk = Annotated[float, _quantity("jerk")]
Angle = Annotated[float, _quantity("angle")]


class Section(BaseModel):
    """A table of the file; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class PartSection(BaseModel):
    """``[part]``: a file, or a formula with its fields."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True)

    file: str | None = None
    formula: str | None = None
    axes: list[str] | None = None
    default_units: Literal["mm", "inch"] = "mm"
    block_delete: bool = False
    start: list[Length] | None = None

    @model_validator(mode="after")
    def _one_of(self) -> PartSection:
        if (self.file is None) == (self.formula is None):
            raise ValueError("give either file (a part program) or formula (a contour by name)")
        if self.file is not None and self.model_extra:
            name = next(iter(self.model_extra))
            raise ValueError(
                f"unknown key {name!r}; with file the allowed keys are axes, block_delete, "
                "default_units, start"
            )
        return self


class FeedSection(Section):
    """``[feed]``: how fast along the contour."""

    kind: Literal["programmed", "constant_rate", "constant_feed"] = "programmed"
    feed: Velocity | None = None
    rapid_feed: Velocity | None = None
    rate: float | None = None
    duration: Time | None = None
    corner_angle: Angle | None = None

    @model_validator(mode="after")
    def _belongs(self) -> FeedSection:
        allowed = {
            "programmed": {"feed", "rapid_feed", "corner_angle"},
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


_FRICTION_VELOCITIES = {"stribeck_velocity", "smoothing_velocity"}


class AxisSection(Section):
    """``[[machine.axis]]``: one axis, by its mass or by its transfer function."""

    name: str
    mass: float | None = None
    viscous: float = 0.0
    gain: float = 1.0
    coulomb: float = 0.0
    breakaway: float | None = None
    stribeck_velocity: Velocity = 1e-2
    smoothing_velocity: Velocity = 1e-4
    numerator: list[float] | None = None
    denominator: list[float] | None = None
    command_limit: float | None = None
    travel: list[Length] | None = None
    resolution: Length = 0.0
    noise: Length = 0.0
    velocity_limit: Velocity
    acceleration_limit: Acceleration
    jerk_limit: Jerk

    @model_validator(mode="after")
    def _one_of(self) -> AxisSection:
        by_function = self.numerator is not None or self.denominator is not None
        if (self.mass is not None) == by_function:
            raise ValueError("give either mass, or numerator and denominator")
        if by_function and (self.numerator is None or self.denominator is None):
            raise ValueError("a transfer function needs numerator and denominator")
        of_mass = {"viscous", "gain", "coulomb", "breakaway"} | _FRICTION_VELOCITIES
        if by_function and (given := sorted(of_mass & self.model_fields_set)):
            raise ValueError(
                f"{', '.join(given)} {'do' if len(given) > 1 else 'does'} not go with a transfer "
                "function, which holds the whole axis"
            )
        if "stribeck_velocity" in self.model_fields_set and not self.breakaway:
            raise ValueError("stribeck_velocity goes with breakaway, which is not given")
        if "smoothing_velocity" in self.model_fields_set and not (self.coulomb or self.breakaway):
            raise ValueError("smoothing_velocity goes with coulomb, which is not given")
        if self.travel is not None and len(self.travel) != 2:
            raise ValueError("travel must be a lower and an upper end")
        return self


class MachineSection(BaseModel):
    """``[machine]``: one by name, with its arguments, or axes."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True)

    name: str | None = None
    axis: list[AxisSection] | None = None
    command: Literal["voltage", "force", "velocity", "position"] | None = None
    computing_delay: Time | None = Field(default=None, ge=0)
    velocity: Literal["difference", "ideal"] | None = None
    set: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_of(self) -> MachineSection:
        if (self.name is None) == (self.axis is None):
            raise ValueError(
                "give either name (an example or published machine) or [[machine.axis]]"
            )
        if self.axis is not None:
            if self.model_extra:
                name = next(iter(self.model_extra))
                raise ValueError(
                    f"unknown key {name!r}; with axes the allowed keys are axis, command, "
                    "computing_delay, set, velocity"
                )
            if self.command is None:
                raise ValueError(
                    "axes need command, the kind that the drives take: "
                    "force, position, velocity or voltage"
                )
            if not self.axis:
                raise ValueError("give one axis or more")
        elif self.command is not None:
            raise ValueError("command is fixed by the named machine; remove it")
        return self


class SimulationSection(Section):
    """``[simulation]``."""

    sample_time: Time = Field(default=1e-3, gt=0)
    substeps: int | None = Field(default=None, ge=1)
    seed: int = Field(default=0, ge=0, lt=2**63)
    disturbance: list[dict[str, Any]] = Field(default_factory=list)


class ReportSection(Section):
    """``[report]``."""

    title: str = ""
    magnification: float | None = Field(default=None, gt=0, allow_inf_nan=False)


class ScenarioSections(Section):
    """The whole file."""

    part: PartSection
    feed: FeedSection = FeedSection()
    machine: MachineSection
    controller: list[dict[str, Any]] = Field(min_length=1)
    simulation: SimulationSection = SimulationSection()
    report: ReportSection = ReportSection()
