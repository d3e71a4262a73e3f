"""Which of a law's inputs LinuxCNC can give, and the C lines that fill them.

LinuxCNC hands over where each joint is to be, with its velocity and acceleration, and where it is.
The servo layer makes the rest: the path's tangent and curvature from that motion, and points ahead
by following the planner some cycles late (``templates/linuxcnc/servo.c.j2``).
"""

from __future__ import annotations

import dataclasses

from contourlab.errors import RefusedError
from contourlab.export.generate import GeneratedC
from contourlab.export.law_facts import LawFacts

__all__ = ["LawInputs", "law_inputs"]

POINT = {
    "parameter": "parameter",
    "parameter_rate": "parameter_rate",
    "parameter_acceleration": "parameter_acceleration",
    "position": "position",
    "velocity": "velocity",
    "acceleration": "acceleration",
    "jerk": "jerk",
}
"""Fields of a reference point that the servo layer knows, all over arc length."""


@dataclasses.dataclass(frozen=True)
class LawInputs:
    """How a law's inputs are filled in the servo layer."""

    lines: tuple[str, ...]
    """C statements: ``law`` points to the inputs, ``now`` to the reference point."""
    delay: int
    """Servo cycles by which the law follows the planner: its preview."""
    order: int
    """Of the contour derivatives; -1 for none."""


def law_inputs(generated: GeneratedC, facts: LawFacts) -> LawInputs:
    """Return how a law's inputs are filled from what LinuxCNC gives.

    Parameters
    ----------
    generated
        The exported law.
    facts
        What it asks for.

    Raises
    ------
    RefusedError
        LinuxCNC cannot give an input; says which and why.
    """
    _refuse(facts)
    n, prefix = facts.n_axes, generated.prefix
    lines: list[str] = []
    delay, order = facts.needs.preview, -1
    for field in generated.inputs:
        real = f"({prefix}_real)"
        root, _, leaf = field.path.partition(".")
        if root == "time":
            lines.append(
                f"law->{field.name} = {real}((double)state->cycle * {prefix}_SAMPLE_TIME);"
            )
        elif root in ("reference", "preview") and leaf in POINT:
            lines += _point_lines(field.name, leaf, field.shape, root == "preview", real, n)
        elif root == "geometry":
            if field.shape[-1] != n:
                raise RefusedError(
                    f"{facts.name} takes the path in {field.shape[-1]} coordinates on {n} axes: "
                    "LinuxCNC's joints give the motion of the axes only"
                )
            order = field.shape[0] - 1
            if order >= 0:
                target = f"({prefix}_real *)law->{field.name}"
                lines.append(f"fill_geometry(now, {target}, {field.shape[0]});")
        elif root == "position":
            lines += _loop(f"law->{field.name}[i] = {real}state->last_position[i];")
        elif root == "velocity":
            lines += _loop(f"law->{field.name}[i] = {real}velocity[i];")
        else:
            raise RefusedError(
                f"{facts.name} reads {field.path or field.name}, which LinuxCNC does not give"
            )
    return LawInputs(tuple(lines), delay, order)


def _point_lines(
    name: str, leaf: str, shape: tuple[int, ...], ahead: bool, real: str, n: int
) -> list[str]:
    if not ahead:
        if shape == ():
            return [f"law->{name} = {real}now->{leaf};"]
        return _loop(f"law->{name}[i] = {real}now->{leaf}[i];")
    rows = shape[0]
    if len(shape) == 1:
        return [
            f"for (i = 0; i < {rows}; i++) {{",
            f"    law->{name}[i] = {real}now[i + 1].{leaf};",
            "}",
        ]
    return [
        f"for (i = 0; i < {rows * n}; i++) {{",
        f"    (({real[1:-1]} *)law->{name})[i] = {real}now[i / {n} + 1].{leaf}[i % {n}];",
        "}",
    ]


def _loop(statement: str) -> list[str]:
    return ["for (i = 0; i < N; i++) {", f"    {statement}", "}"]


def _refuse(facts: LawFacts) -> None:
    if facts.needs.own_time:
        raise RefusedError(
            f"{facts.name} plans its own time along the contour; LinuxCNC's planner does that "
            "already and cannot be led: take a law that follows a reference"
        )
    if facts.needs.contour:
        raise RefusedError(
            f"{facts.name} evaluates the one contour that it was bound to. In LinuxCNC it would "
            "pull towards it during approaches, rapids and jogs too, which are not on it: take a "
            "law or an estimator that works on the motion, such as TangentEstimator or "
            "OsculatingCircleEstimator"
        )
