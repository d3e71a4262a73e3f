"""A control law as programs: ``init`` and ``step``, traced once."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.contours.base import Contour
from contourlab.controllers.base import BoundController
from contourlab.export.fields import Field, fields_of
from contourlab.export.flatten import Program, Variable, flatten
from contourlab.recordings.sample import Sample

__all__ = ["LARGEST_PARAMETER", "Leaf", "TracedLaw", "law_outputs", "trace_law"]

LARGEST_PARAMETER = 64
"""Elements of an array up to which it is a run-time parameter; larger ones are tables."""

_POINT = {
    "parameter_rate": "1/s", "parameter_acceleration": "1/s^2", "position": "m", "velocity": "m/s",
    "acceleration": "m/s^2", "jerk": "m/s^3",
}  # fmt: skip
SAMPLE_UNITS = {
    "time": "s", "position": "m", "velocity": "m/s",
    "geometry": "m per parameter^row",
    **{f"{where}.{k}": unit for where in ("reference", "preview") for k, unit in _POINT.items()},
}  # fmt: skip


@dataclasses.dataclass(frozen=True, eq=False)
class Leaf:
    """One array that a program takes."""

    field: Field
    dtype: Any
    value: Any
    """As traced: default of a parameter, numbers of a table."""
    fixed: bool = False
    """Whether it becomes part of the code."""


@dataclasses.dataclass(frozen=True, eq=False)
class TracedLaw:
    """What there is to write of a law."""

    law: BoundController
    parameters: list[Leaf]
    state: list[Leaf]
    inputs: list[Leaf]
    outputs: list[Leaf]
    init: Program
    """Of parameters and inputs; gives the state."""
    step: Program
    """Of parameters, state and inputs; gives the new state and the outputs."""

    def reads(self, group: list[Leaf], leaf: Leaf) -> bool:
        """Return whether init or step read a leaf.

        Parameters
        ----------
        group
            ``parameters``, ``state`` or ``inputs``.
        leaf
            One of them.
        """
        place = group.index(leaf)
        n_parameters, n_state = len(self.parameters), len(self.state)
        in_init = {id(self.parameters): 0, id(self.inputs): n_parameters}.get(id(group))
        in_step = {
            id(self.parameters): 0, id(self.state): n_parameters,
            id(self.inputs): n_parameters + n_state,
        }[id(group)]  # fmt: skip
        found = [(self.step, in_step)]
        if in_init is not None:
            found.append((self.init, in_init))
        return any(_used(program, program.inputs[first + place]) for program, first in found)


def _used(program: Program, variable: Variable) -> bool:
    return any(variable in one.inputs for one in program.equations) or variable in program.outputs


def law_outputs(law: BoundController, command: Any, state: Any) -> dict[str, Any]:
    """Return what a step gives: command, status, whether it has finished, telemetry by name.

    Parameters
    ----------
    law
        Bound.
    command
        Of the step.
    state
        After the step.
    """
    found = {"command": command, "status": law.status(state), "finished": law.finished(state)}
    for key, value in law.telemetry(state).items():
        found[key if key not in found else f"telemetry_{key}"] = value
    arrays = {key: jnp.asarray(one) for key, one in found.items()}
    return {
        key: one.astype(jnp.int32) if one.dtype.kind in "iub" else one
        for key, one in arrays.items()
    }


def trace_law(law: BoundController, sample: Sample, *, command_unit: str = "") -> TracedLaw:
    """Return a law's functions as programs.

    Parameters
    ----------
    law
        Bound to its contour and sample time.
    sample
        One instant, as the loop would hand it over; only shapes and types matter.
    command_unit
        Of the law's command; empty where it is not known.
    """
    sample = jax.tree.map(jnp.asarray, sample)
    leaves, structure = jax.tree.flatten(law)
    state = jax.jit(lambda s: law.init(s))(sample)
    state_leaves, state_structure = jax.tree.flatten(state)
    sample_leaves, sample_structure = jax.tree.flatten(sample)

    def init(leaves: Any, sample_leaves: Any) -> Any:
        law = jax.tree.unflatten(structure, leaves)
        return jax.tree.leaves(law.init(jax.tree.unflatten(sample_structure, sample_leaves)))

    order: list[str] = []  # jax sorts the keys of a dict

    def step(leaves: Any, state_leaves: Any, sample_leaves: Any) -> Any:
        law = jax.tree.unflatten(structure, leaves)
        state = jax.tree.unflatten(state_structure, state_leaves)
        sample = jax.tree.unflatten(sample_structure, sample_leaves)
        command, after = law.step(state, sample)
        found = law_outputs(law, command, after)
        order[:] = found
        return jax.tree.leaves(after), list(found.values())

    leaves = [jnp.asarray(one) for one in leaves]
    state_leaves = [jnp.asarray(one) for one in state_leaves]
    traced = jax.make_jaxpr(step)(leaves, state_leaves, sample_leaves)
    shapes = traced.out_avals[len(state_leaves) :]
    first = {k: np.zeros(one.shape, one.dtype) for k, one in zip(order, shapes, strict=True)}
    fixed = _fixed(law)
    named = jax.tree_util.tree_unflatten(structure, leaves)
    return TracedLaw(
        law=law,
        parameters=[
            Leaf(field, np.asarray(value).dtype, np.asarray(value), keep)
            for field, value, keep in zip(
                _safe_fields(named, command_unit), leaves, fixed, strict=True
            )
        ],
        state=_leaves(state, "state of the law", law.state_units, command_unit=command_unit),
        inputs=_leaves(sample, "sample", SAMPLE_UNITS),
        outputs=_ordered(first, law, state, command_unit),
        init=flatten(jax.make_jaxpr(init)(leaves, sample_leaves)),
        step=flatten(traced),
    )


def _safe_fields(tree: Any, command_unit: str) -> list[Field]:
    """Return fields of the law's own arrays; what is no number that users set stays in the code."""
    shown = jax.tree.map(
        lambda one: one if one.dtype in (np.float64, np.int32, np.bool_) else np.zeros(one.shape),
        tree,
    )
    return fields_of(shown, what="law", command_unit=command_unit)


def _leaves(
    tree: Any, what: str, units: dict[str, str] | None = None, *, command_unit: str = ""
) -> list[Leaf]:
    fields = fields_of(tree, what=what, units=units, command_unit=command_unit)
    values = [np.asarray(one) for one in jax.tree.leaves(tree)]
    return [Leaf(field, value.dtype, value) for field, value in zip(fields, values, strict=True)]


def _ordered(
    outputs: dict[str, Any], law: BoundController, state: Any, command_unit: str
) -> list[Leaf]:
    """Return the outputs; telemetry that is called like a part of the state is told like it."""
    said: dict[str, tuple[str, str]] = {}
    for one in fields_of(state, what="state of the law", command_unit=command_unit):
        said.setdefault(one.path.rpartition(".")[2], (one.unit, one.text))
    meanings = ", ".join(f"{number} {meaning}" for number, meaning in enumerate(law.statuses))
    said |= {
        "command": (command_unit, "Acts from this instant to the next"),
        "status": ("", meanings),
        "finished": ("", "1 once a law that plans its own time has arrived"),
        "contour_error_estimate": ("m", "As the law estimates it, from the tool to the path"),
    }
    found = []
    for key, value in outputs.items():
        field = fields_of({key: value}, what="output")[0]
        unit, text = said.get(key, ("", ""))
        found.append(Leaf(dataclasses.replace(field, unit=unit, text=text), value.dtype, value))
    return found


def _fixed(law: Any) -> list[bool]:
    """Return which leaves become code: contours, sample times, whole numbers, large arrays."""

    def inside(path: Any) -> bool:
        owner = law
        for key in path:
            if isinstance(owner, Contour):
                return True
            from contourlab.export.fields import _child

            owner = _child(owner, key)
        return False

    found = []
    for path, leaf in jax.tree_util.tree_flatten_with_path(law)[0]:
        array = np.asarray(leaf)
        last = str(getattr(path[-1], "name", "")) if path else ""
        found.append(
            array.dtype != np.float64
            or array.size > LARGEST_PARAMETER
            or last == "sample_time"
            or inside(path)
        )
    return found
