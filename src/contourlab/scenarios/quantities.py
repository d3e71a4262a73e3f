"""What sections of TOML files are made of: tables without unknown keys, values with units."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict

from contourlab.units import parse_quantity

__all__ = ["Acceleration", "Angle", "Jerk", "Length", "Section", "Time", "Velocity"]


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
