"""``[machine]`` of a scenario, which is also the whole of a machine file, and what it may hold."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    field_validator,
    model_validator,
)

from contourlab.scenarios.quantities import (
    Acceleration,
    Angle,
    Jerk,
    Length,
    Section,
    Time,
    Velocity,
)
from contourlab.units import parse_quantity

__all__ = [
    "AxisSection",
    "BallScrewSection",
    "CoggingSection",
    "FrictionSection",
    "MachineSection",
    "NominalSection",
    "PositionErrorSection",
    "SquarenessSection",
    "StateSpaceSection",
    "TwoMassSection",
]

Side = Literal["tool", "motor"]


def _end(value: object) -> float:
    return math.nan if value == "unlimited" else parse_quantity(value, "length")


End = Annotated[float, BeforeValidator(_end)]
"""One end of a travel: a length, or ``"unlimited"``, which is NaN until the side is known."""


class FrictionSection(Section):
    """Dry friction of the motor side, in the unit of effort there."""

    coulomb: float
    coulomb_backward: float | None = None
    breakaway: float | None = None
    stribeck_velocity: Velocity = 1e-2
    smoothing_velocity: Velocity = 1e-4


class TwoMassSection(Section):
    """``two_mass``: motor and load with a spring, by numbers or by frequencies."""

    motor_mass: float | None = None
    load_mass: float | None = None
    stiffness: float | None = None
    damping: float | None = None
    mass: float | None = None
    mass_ratio: float | None = None
    anti_resonance_hz: float | None = None
    damping_ratio: float | None = None
    motor_viscous: float = 0.0
    load_viscous: float = 0.0
    gain: float = 1.0
    backlash: Length | None = None
    motor_friction: FrictionSection | None = None

    @model_validator(mode="after")
    def _one_of(self) -> TwoMassSection:
        numbers = ("motor_mass", "load_mass", "stiffness")
        frequencies = ("mass", "mass_ratio", "anti_resonance_hz", "damping_ratio")
        by_number = [name for name in (*numbers, "damping") if getattr(self, name) is not None]
        by_frequency = [name for name in frequencies if getattr(self, name) is not None]
        wanted = numbers if by_number else frequencies
        missing = [name for name in wanted if getattr(self, name) is None]
        if (by_number and by_frequency) or missing:
            raise ValueError(
                f"give either {', '.join(numbers)} (and damping), or {', '.join(frequencies)}"
            )
        return self


class BallScrewSection(Section):
    """``ball_screw``: motor and screw by their data sheets."""

    lead: Length
    motor_inertia_kg_m2: float
    screw_inertia_kg_m2: float = 0.0
    table_mass_kg: float
    motor_viscous_n_m_s: float = 0.0
    table_viscous_n_s_per_m: float = 0.0
    torque_constant_n_m_per_a: float | None = None
    amplifier_gain_a_per_v: float | None = None
    stiffness_n_per_m: float | None = None
    damping_ratio: float | None = None
    backlash: Length | None = None
    motor_friction: FrictionSection | None = None


class StateSpaceSection(Section):
    """``state_space``: identified matrices, of one axis or of all."""

    state_matrix: list[list[float]]
    input_matrix: list[list[float]]
    output_matrix: list[list[float]]
    direct_matrix: list[list[float]] | None = None
    sample_time: Time | None = Field(default=None, gt=0)
    output: Literal["position", "velocity"] = "position"
    resample: bool = False

    @model_validator(mode="after")
    def _rectangular(self) -> StateSpaceSection:
        for name in ("state_matrix", "input_matrix", "output_matrix", "direct_matrix"):
            rows = getattr(self, name)
            if rows is not None and (not rows or len({len(row) for row in rows}) != 1):
                raise ValueError(f"{name} must be rows of one length")
        if self.resample and self.sample_time is None:
            raise ValueError("resample goes with sample_time, of a discrete model")
        return self


class CoggingSection(Section):
    """One entry of ``cogging``."""

    amplitude: float
    period: Length
    phase: Angle = 0.0


class PositionErrorSection(Section):
    """``screw_error`` and ``scale_error``."""

    scale: float = 0.0
    amplitude: Length = 0.0
    period: Length | None = None
    phase: Angle = 0.0

    @model_validator(mode="after")
    def _whole(self) -> PositionErrorSection:
        if self.amplitude and self.period is None:
            raise ValueError("amplitude needs period")
        return self


class SquarenessSection(Section):
    """One entry of ``squareness``: two axes, the first being the datum."""

    axes: list[str]
    angle: Angle


class NominalSection(Section):
    """``nominal``: what laws are told of an axis instead of the truth."""

    mass: float
    viscous: float
    coulomb: float = 0.0
    gain: float = 1.0
    command_limit: float | None = None
    stiffness: float | None = None


_KINDS = ("mass", "numerator", "two_mass", "ball_screw", "state_space")
_FLAT_FRICTION = ("coulomb", "coulomb_backward", "breakaway", "stribeck_velocity",
                  "smoothing_velocity")  # fmt: skip
_GIVE = "give either mass, or numerator and denominator, or two_mass, ball_screw or state_space"
_LIMITS = ("velocity_limit", "acceleration_limit", "jerk_limit")


class AxisSection(Section):
    """``[[machine.axis]]``: one axis and what stands for its dynamics."""

    name: str
    mass: float | None = None
    viscous: float = 0.0
    gain: float = 1.0
    coulomb: float = 0.0
    coulomb_backward: float | None = None
    breakaway: float | None = None
    stribeck_velocity: Velocity = 1e-2
    smoothing_velocity: Velocity = 1e-4
    numerator: list[float] | None = None
    denominator: list[float] | None = None
    two_mass: TwoMassSection | None = None
    ball_screw: BallScrewSection | None = None
    state_space: StateSpaceSection | None = None
    cogging: list[CoggingSection] = Field(default_factory=list)
    command_limit: float | None = None
    travel: list[End] | None = None
    resolution: Length = 0.0
    noise: Length = 0.0
    measured: Side = "tool"
    velocity_measured: Side | None = None
    screw_error: PositionErrorSection | None = None
    scale_error: PositionErrorSection | None = None
    nominal: NominalSection | None = None
    velocity_limit: Velocity | None = None
    acceleration_limit: Acceleration | None = None
    jerk_limit: Jerk | None = None

    @property
    def kind(self) -> str | None:
        """What stands for the dynamics of the axis; None if it is all in ``[state_space]``."""
        given = [name for name in _KINDS if getattr(self, name) is not None]
        return given[0] if given else None

    @field_validator("travel")
    @classmethod
    def _two_ends(cls, ends: list[float] | None) -> list[float] | None:
        if ends is not None and len(ends) != 2:
            raise ValueError("travel must be a lower and an upper end")
        return ends

    @model_validator(mode="after")
    def _one_of(self) -> AxisSection:
        by_function = self.numerator is not None or self.denominator is not None
        given = [name for name in _KINDS if getattr(self, name) is not None]
        if len(given) > 1 or (self.mass is not None and by_function):
            raise ValueError(_GIVE)
        if by_function and (self.numerator is None or self.denominator is None):
            raise ValueError("a transfer function needs numerator and denominator")
        rough = {*_FLAT_FRICTION, "cogging"}
        wrong: set[str] = set()
        if self.kind in ("numerator", "state_space", None):
            wrong = rough | {"viscous", "gain"}
        elif self.kind in ("two_mass", "ball_screw"):
            wrong = {"viscous", "gain"}
        if misplaced := sorted(wrong & self.model_fields_set):
            many = "do" if len(misplaced) > 1 else "does"
            what = {
                "numerator": "a transfer function, which holds the whole axis",
                "two_mass": "two_mass, which holds its own",
                "ball_screw": "ball_screw, which holds its own",
            }.get(self.kind or "", "a state space, which holds the whole axis")
            if self.kind is None:
                raise ValueError(_GIVE)
            raise ValueError(f"{', '.join(misplaced)} {many} not go with {what}")
        if "stribeck_velocity" in self.model_fields_set and not self.breakaway:
            raise ValueError("stribeck_velocity goes with breakaway, which is not given")
        if "smoothing_velocity" in self.model_fields_set and not (self.coulomb or self.breakaway):
            raise ValueError("smoothing_velocity goes with coulomb, which is not given")
        limits = [name for name in _LIMITS if getattr(self, name) is None]
        if 0 < len(limits) < len(_LIMITS):
            raise ValueError(f"{limits[0]} is missing: give {', '.join(_LIMITS)}, or none of them")
        return self


_OF_AXES = ("command", "state_space", "squareness", "tool_matrix", "title", "source", "assumed")


class MachineSection(BaseModel):
    """``[machine]``: one by name with its arguments, one from a file, or axes."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True)

    name: str | None = None
    file: str | None = None
    axis: list[AxisSection] | None = None
    command: Literal["voltage", "force", "velocity", "position"] | None = None
    computing_delay: Time | None = Field(default=None, ge=0)
    velocity: Literal["difference", "ideal"] | None = None
    substeps: int | None = Field(default=None, ge=1)
    state_space: StateSpaceSection | None = None
    squareness: list[SquarenessSection] = Field(default_factory=list)
    tool_matrix: list[list[float]] | None = None
    title: str = ""
    source: str = ""
    assumed: list[str] = Field(default_factory=list)
    set: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_of(self) -> MachineSection:
        if sum(value is not None for value in (self.name, self.file, self.axis)) != 1:
            raise ValueError(
                "give either name (an example or published machine), file (a machine file), or "
                "[[machine.axis]]"
            )
        if self.axis is None:
            self._has_its_own("the named machine" if self.file is None else "the machine file")
        if self.name is None and self.model_extra:
            name = next(iter(self.model_extra))
            allowed = sorted(set(type(self).model_fields) - {"name", "file"})
            if self.axis is None:
                allowed = ["computing_delay", "file", "set", "substeps", "velocity"]
            raise ValueError(
                f"unknown key {name!r}; with {'axes' if self.axis else 'file'} the allowed keys "
                f"are {', '.join(allowed)}"
            )
        if self.axis is not None:
            self._check_axes(self.axis)
        return self

    def _has_its_own(self, what: str) -> None:
        for name in _OF_AXES:
            if name in self.model_fields_set:
                raise ValueError(f"{name} is fixed by {what}; remove it")

    def _check_axes(self, axes: list[AxisSection]) -> None:
        if self.command is None:
            raise ValueError(
                "axes need command, the kind that the drives take: "
                "force, position, velocity or voltage"
            )
        if not axes:
            raise ValueError("give one axis or more")
        for axis in axes:
            if (axis.kind is None) == (self.state_space is None):
                raise ValueError(
                    f"axis {axis.name}: give mass, numerator and denominator, two_mass, "
                    "ball_screw or state_space, or one state_space for all axes"
                )
