"""A whole closed loop as one C function: reference in, recording out.

The control step of ``simulation`` (measure, law, machine) is traced once, without the random
numbers that its keys alone decide, and written inside one loop over the samples. Everything of the
machine, the law and the disturbances that is a real number is handed in at run time: another gain
is not another program. Whole numbers and truths, which decide what the program is, are written into
it.

The function takes pointers to arrays, four groups of them::

    void contourlab_loop(int32_t steps, const void *const *given, void *const *state,
                         const void *const *rows, void *const *out);

``given`` stays, ``state`` is read before the first step and written after the last, ``rows`` and
``out`` have a row for each step (rows of the reference also those of the preview). It returns early
if the run has diverged or arrived.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.controllers.base import BoundController, Needs
from contourlab.errors import ExportError
from contourlab.export.c_helpers import helper_text
from contourlab.export.draws import Draws, separate_draws
from contourlab.export.expressions import Index, constant, load, name, operation
from contourlab.export.flatten import flatten
from contourlab.export.optimise import drop_unused, join_single_uses
from contourlab.export.primitives.emission import run
from contourlab.export.primitives.loops import Carry as Carried
from contourlab.export.primitives.loops import update
from contourlab.export.printing import Printer
from contourlab.export.scalar_types import Precision, c_type, supported
from contourlab.export.statements import Break, Builder, Copy, Store
from contourlab.export.tracing import LARGEST_PARAMETER
from contourlab.export.values import (
    SMALL,
    Atoms,
    Known,
    Stored,
    Value,
    atoms,
    flat_index,
    indices,
    stored,
)
from contourlab.machines import BoundMachine, Disturbance
from contourlab.recordings.reference import ReferencePoint
from contourlab.recordings.sample import Sample
from contourlab.simulation.loop import Carry, control_step

__all__ = ["FUNCTION", "LoopSource", "Parts", "loop_source"]

FUNCTION = "contourlab_loop"
Shape = tuple[int, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class Parts:
    """The arrays of a loop, as one step knows them.

    Parameters
    ----------
    machine, law, disturbances
        Bound.
    sample_time, reach
        [s] and [m].
    carry
        Before the first step.
    point
        Of the reference, at one instant.
    geometry
        At one instant.
    needs
        Of the law.
    """

    machine: BoundMachine
    law: BoundController
    disturbances: tuple[Disturbance, ...]
    sample_time: Any
    reach: Any
    carry: Carry
    point: ReferencePoint
    geometry: Any
    needs: Needs

    @property
    def given(self) -> Any:
        """What stays, as a tree."""
        return self.machine, self.law, self.disturbances, self.sample_time, self.reach

    @property
    def preview(self) -> ReferencePoint:
        """Points ahead; only shapes matter."""
        ahead = (self.needs.preview,)
        return jax.tree.map(  # type: ignore[no-any-return]
            lambda one: np.zeros((*ahead, *np.shape(one)), np.float64), self.point
        )


@dataclasses.dataclass(frozen=True, eq=False)
class LoopSource:
    """A loop as C text, and what its pointers are.

    Parameters
    ----------
    text
        Of the file.
    draws
        The random numbers that are drawn beforehand.
    outputs
        Name, shape and NumPy type of a row of each array that comes out.
    """

    text: str
    draws: Draws
    outputs: tuple[tuple[str, Shape, Any], ...]


def is_code(leaf: Any) -> bool:
    """Return whether an array that stays is written into the program.

    Parameters
    ----------
    leaf
        Of machine, law or disturbances.
    """
    return bool(leaf.dtype.kind in "iub" and leaf.size <= LARGEST_PARAMETER)


def loop_source(parts: Parts) -> LoopSource:
    """Return a loop as C.

    Parameters
    ----------
    parts
        Of the loop.

    Raises
    ------
    ExportError
        It uses what cannot be exported; names it and the line that it comes from.
    """
    given, given_structure = jax.tree.flatten(parts.given)
    state, state_structure = jax.tree.flatten(parts.carry)
    points, point_structure = jax.tree.flatten(parts.point)
    ahead = jax.tree.leaves(parts.preview)
    shown: list[str] = []

    def step(given: Any, state: Any, points: Any, geometry: Any, ahead: Any) -> Any:
        machine, law, disturbances, sample_time, reach = jax.tree.unflatten(given_structure, given)
        carry = jax.tree.unflatten(state_structure, state)
        measurement = machine.measure(carry.machine)
        sample = Sample(
            time=carry.step * sample_time,
            reference=jax.tree.unflatten(point_structure, points),
            geometry=geometry,
            preview=jax.tree.unflatten(point_structure, ahead),
            position=measurement.position,
            velocity=measurement.velocity,
        )
        after, out = control_step(machine, law, disturbances, carry, sample, reach, freeze=False)
        telemetry = {f"telemetry.{key}": one for key, one in out.pop("telemetry").items()}
        found = {key: jnp.asarray(one) for key, one in {**out, **telemetry}.items()}
        shown[:] = found
        return jax.tree.leaves(after), list(found.values())

    geometry = np.asarray(parts.geometry)
    closed = jax.make_jaxpr(step)(given, state, points, geometry, ahead)
    _check_carry(closed, parts.carry, len(given))
    n_given, n_state = len(given), len(state)
    draws = separate_draws(closed, [(n_given + k, k) for k in range(n_state)])
    writer = _Writer(draws)
    for k, leaf in enumerate(given):
        writer.give(k, np.asarray(leaf))
    for k, leaf in enumerate(state):
        if n_given + k not in draws.keys:
            writer.carry(k, leaf)
    outputs = [
        (key, tuple(aval.shape), np.dtype(aval.dtype))
        for key, aval in zip(shown, closed.out_avals[n_state:], strict=True)
    ]
    rows = [np.asarray(one) for one in (*points, geometry)]
    text = writer.write(rows, parts.needs.preview, len(points), outputs, _ends(parts.carry))
    return LoopSource(text, draws, tuple(outputs))


def _ends(carry: Carry) -> list[int]:
    """Return the places of the numbers that say that a run is over."""
    leaves, structure = jax.tree.flatten(carry)
    place: Any = jax.tree.unflatten(structure, range(len(leaves)))
    return [place.diverged_step, place.finished_step]


def _check_carry(closed: Any, carry: Carry, n_given: int) -> None:
    places = jax.tree_util.tree_flatten_with_path(carry)[0]
    for k, (path, _) in enumerate(places):
        before, after = closed.in_avals[n_given + k], closed.out_avals[k]
        if before.shape != after.shape or before.dtype != after.dtype:
            raise ExportError(
                f"the state {jax.tree_util.keystr(path)} is {before.dtype}{list(before.shape)} "
                f"before a step and {after.dtype}{list(after.shape)} after it"
            )


class _Writer:
    """Puts the function together.

    Parameters
    ----------
    draws
        What is drawn beforehand, and the step without it.
    """

    def __init__(self, draws: Draws) -> None:
        self.draws = draws
        self.builder, self.printer = Builder({}), Printer(FUNCTION, Precision())
        self.pointers: dict[str, tuple[str, int, Any]] = {}
        """Name in C, to group, place in it and type."""
        self.given: list[Value] = []
        self.carries: dict[int, Carried] = {}

    def give(self, place: int, leaf: Any) -> None:
        """Take an array that stays.

        Parameters
        ----------
        place
            Among those that stay.
        leaf
            Its numbers, of which those that are code are used.
        """
        if is_code(leaf) or leaf.size == 0:
            self.given.append(Known(leaf))
            return
        label = self._pointer("given", place, leaf.dtype)
        self.given.append(self._read(label, leaf.shape, leaf.dtype))

    def carry(self, place: int, leaf: Any) -> None:
        """Take an array of the state.

        Parameters
        ----------
        place
            In the state.
        leaf
            Of which shape and type are used.
        """
        if leaf.size == 0:
            self.carries[place] = Carried(self.builder, Known(np.zeros(leaf.shape, leaf.dtype)))
            return
        label = self._pointer("state", place, leaf.dtype)
        self.carries[place] = Carried(self.builder, self._read(label, leaf.shape, leaf.dtype))

    def write(
        self, rows: list[Any], preview: int, n_points: int, outputs: Sequence[Any], ends: list[int]
    ) -> str:
        """Return the text.

        Parameters
        ----------
        rows
            One instant of the reference and of the geometry; shapes and types are used.
        preview
            Points ahead.
        n_points
            How many of the rows are of the reference.
        outputs
            Name, shape and type of each row that comes out.
        ends
            Places of the numbers of the state that say that the run is over.
        """
        builder, draws = self.builder, self.draws
        with builder.loop("steps") as k:
            now = [self._row(n, one.shape, one.dtype, k) for n, one in enumerate(rows)]
            ahead = [
                self._row(n, (preview, *one.shape), one.dtype, k + 1, stride=one.size)
                for n, one in enumerate(rows[:n_points])
            ]
            drawn = [
                self._row(len(rows) + n, shape, kind, k)
                for n, (shape, kind) in enumerate(draws.shapes)
            ]
            leading = [
                drawn[one] if isinstance(one, int) else Known(np.asarray(one))
                for one in draws.leading
            ]
            order = sorted(self.carries)
            state = [self.carries[one].inside(builder) for one in order]
            found = run(
                builder, flatten(draws.step), [*leading, *self.given, *state, *now, *ahead]
            )  # fmt: skip
            values = found[len(order) :]
            for number, ((_, shape, kind), value) in enumerate(zip(outputs, values, strict=True)):
                self._put(number, shape, kind, value, k)
            builder.line = ""
            update(builder, [self.carries[one] for one in order], found[: len(order)])
            builder.add(Break(self._going(ends), ""))
        for place in order:
            self._keep(place)
        return self._text()

    def _pointer(self, group: str, place: int, dtype: Any) -> str:
        if not supported(dtype):
            raise ExportError(f"arrays of type {dtype} cannot be exported")
        label = f"{group[0]}{place}"
        self.pointers[label] = (group, place, np.dtype(dtype))
        return label

    def _read(self, label: str, shape: Shape, dtype: Any) -> Value:
        size = int(np.prod(shape, dtype=int))
        if size > SMALL:
            return Stored(shape, dtype, label)
        elements = [self.builder.bind(load(label, Index(k), dtype)) for k in range(size)]
        return Atoms(self.builder, shape, dtype, elements)

    def _row(
        self, place: int, shape: Shape, dtype: Any, k: Index, stride: int | None = None
    ) -> Value:
        size = int(np.prod(shape, dtype=int))
        if size == 0:
            return Known(np.zeros(shape, dtype))
        label = self._pointer("rows", place, dtype)
        row = Stored(shape, dtype, label, k * (size if stride is None else stride))
        return atoms(self.builder, row) if row.small else row

    def _put(self, place: int, shape: Shape, dtype: Any, value: Value, k: Index) -> None:
        if value.size == 0:
            return
        label = self._pointer("out", place, dtype)
        where = k * value.size
        if value.small:
            for at in indices(shape):
                element = self.builder.bind(value.at(self.builder, at))
                self.builder.add(Store(label, flat_index(shape, at) + where, element, ""))
            return
        with self.builder.loops(shape) as at:
            element = self.builder.bind(value.at(self.builder, at))
            self.builder.add(Store(label, flat_index(shape, at) + where, element, ""))

    def _going(self, ends: list[int]) -> Any:
        going = None
        for place in ends:
            one = self.carries[place].elements[0]
            test = operation("lt", np.bool_, one, constant(0, one.dtype))
            going = test if going is None else operation("and", np.bool_, going, test)
        return going

    def _keep(self, place: int) -> None:
        carry, builder = self.carries[place], self.builder
        if carry.value.size == 0:
            return
        label = f"s{place}"
        if isinstance(carry.value, Atoms):
            for k, one in enumerate(carry.elements):
                builder.add(Store(label, Index(k), name(str(one.value), one.dtype), ""))
        else:
            array = stored(builder, carry.value)
            builder.add(Copy(label, array.array, array.size, ""))

    def _text(self) -> str:
        builder, printer = self.builder, self.printer
        block = builder.stack[0]
        wanted = {label for label in self.pointers if label[0] in "so"}
        drop_unused(block, wanted)
        join_single_uses(block)
        drop_unused(block, wanted)
        body = printer.block(block)
        text = "\n".join(body)
        lines = ["#include <math.h>", "#include <stdbool.h>", "#include <stdint.h>",
                 "#include <string.h>", "", f"typedef double {printer.real};", ""]  # fmt: skip
        for table in builder.tables.values():
            if re.search(rf"\b{FUNCTION}_{table.name}\b", text):
                lines += printer.table(table)
        for label, (what, dtype) in sorted(printer.helpers.items()):
            lines.append(helper_text(label, what, dtype, printer.real, printer.precision))
        groups = (("given", "const "), ("state", ""), ("rows", "const "), ("out", ""))
        arguments = ", ".join(f"{'const ' if c else ''}void *const *{g}" for g, c in groups)
        lines += [f"void {FUNCTION}(int32_t steps, {arguments});",
                  f"void {FUNCTION}(int32_t steps, {arguments})", "{"]  # fmt: skip
        lines += [f"    (void){group};" for group, _ in groups]
        for label, (group, place, dtype) in self.pointers.items():
            if not re.search(rf"\b{label}\b", text):
                continue
            kind = f"{dict(groups)[group]}{c_type(dtype, printer.real)}"
            lines.append(f"    {kind} *const restrict {label} = {group}[{place}];")
        return "\n".join([*lines, *body, "}", ""])
