"""C99 from a bound law: header, source, and what stands in them."""

from __future__ import annotations

import dataclasses
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

import contourlab
from contourlab.controllers.base import BoundController
from contourlab.errors import ConfigurationError
from contourlab.export.c_helpers import helper_text
from contourlab.export.expressions import Expression, operation
from contourlab.export.fields import Field, value_of
from contourlab.export.flatten import Program
from contourlab.export.operations import count_operations
from contourlab.export.optimise import drop_unused, join_single_uses
from contourlab.export.primitives.emission import run
from contourlab.export.printing import Printer, comment
from contourlab.export.scalar_types import Precision, is_real, literal
from contourlab.export.statements import Assign, Block, Builder, Copy, Set, Table
from contourlab.export.tracing import Leaf, TracedLaw, trace_law
from contourlab.export.values import SMALL, Known, Value, atoms, stored
from contourlab.recordings.sample import Sample
from contourlab.simulation.result import COMMAND_UNITS

__all__ = ["GeneratedC", "check_prefix", "generate"]

WIDTH = 110
"""Columns beyond which a comment of the header stands above its member."""


@dataclasses.dataclass(frozen=True)
class GeneratedC:
    """A law as C: texts of two files, and what stands in them.

    Parameters
    ----------
    prefix
        Of every external name.
    precision
        ``"double"`` or ``"single"``.
    sample_time
        Time between steps that the law was bound to [s].
    header, source
        Texts of ``PREFIX.h`` and ``PREFIX.c``.
    parameters, state, inputs, outputs
        Fields of the four structures, in their order.
    operations
        Worst number of operations in one step: additions, comparisons, choices, conversions,
        functions of libm, one each.
    defaults
        Values of the parameters, by field name.
    statuses
        What each status number means.
    law
        Name of the law's class.
    iterates
        Whether a step iterates on real numbers until something has converged.
    operations_once
        Operations likewise, if every loop that ends by itself ends after one pass.
    """

    prefix: str
    precision: str
    sample_time: float
    header: str
    source: str
    parameters: tuple[Field, ...]
    state: tuple[Field, ...]
    inputs: tuple[Field, ...]
    outputs: tuple[Field, ...]
    operations: int
    defaults: Mapping[str, Any]
    statuses: tuple[str, ...]
    law: str
    iterates: bool = False
    operations_once: int = 0


def check_prefix(prefix: str) -> str:
    """Return a prefix that can begin names in C.

    Parameters
    ----------
    prefix
        As given.

    Raises
    ------
    ConfigurationError
        It is no identifier of C.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,40}", prefix, re.ASCII):
        raise ConfigurationError(
            "prefix must be a letter followed by letters, digits and _, 41 at the most, "
            f"got {prefix!r}"
        )
    return prefix


def generate(
    law: BoundController,
    sample: Sample,
    *,
    sample_time: float,
    prefix: str = "controller",
    precision: str = "double",
    command: str = "",
) -> GeneratedC:
    """Return a law as C99.

    Parameters
    ----------
    law
        Bound to its contour and sample time.
    sample
        One instant, as the loop would hand it over; only shapes matter.
    sample_time
        That the law was bound to [s].
    prefix
        Of every external name.
    precision
        ``"double"`` or ``"single"``.
    command
        Kind of the law's command, such as ``"force"``: units follow from it.

    Raises
    ------
    ExportError
        The law uses what cannot be exported; names it and the line of the law.
    ConfigurationError
        A prefix or a precision that there is not.
    """
    kind = Precision(precision)
    printer = Printer(check_prefix(prefix), kind)
    traced = trace_law(law, sample, command_unit=COMMAND_UNITS.get(command, ""))
    tables: dict[Any, Table] = {}
    parameters = _live(traced, traced.parameters)
    inputs = _live(traced, traced.inputs)
    init = _function(traced.init, tables, [
        *_given(traced.parameters, "parameters"), *_given(traced.inputs, "inputs"),
    ], [("state", traced.state)])  # fmt: skip
    step = _function(traced.step, tables, [
        *_given(traced.parameters, "parameters"), *_given(traced.state, "state"),
        *_given(traced.inputs, "inputs"),
    ], [("state", traced.state), ("outputs", traced.outputs)])  # fmt: skip
    texts = {name: printer.block(block) for name, block in (("init", init), ("step", step))}
    fields = {
        "parameters": tuple(one.field for one in parameters),
        "state": tuple(one.field for one in traced.state if one.field.size),
        "inputs": tuple(one.field for one in inputs),
        "outputs": tuple(one.field for one in traced.outputs if one.field.size),
    }
    defaults = {one.field.name: one.value for one in parameters}
    name = type(law).__name__.removeprefix("Bound")
    return GeneratedC(
        prefix=prefix, precision=precision, sample_time=float(sample_time),
        header=_header(printer, name, float(sample_time), fields),
        source=_source(printer, name, tables, texts, fields, defaults),
        operations=count_operations(step), defaults=defaults, statuses=tuple(law.statuses),
        law=name, iterates=_iterates(traced.step),
        operations_once=count_operations(step, searches_once=True), **fields,
    )  # fmt: skip


def _iterates(program: Program) -> bool:
    for equation in program.equations:
        inner = [one for one in equation.params.values() if isinstance(one, Program)]
        for several in equation.params.values():
            if isinstance(several, tuple):
                inner += [one for one in several if isinstance(one, Program)]
        reals = any(is_real(one.dtype) for one in equation.outputs)
        if (equation.primitive == "while" and reals) or any(map(_iterates, inner)):
            return True
    return False


def _live(traced: TracedLaw, group: list[Leaf]) -> list[Leaf]:
    return [one for one in group if not one.fixed and one.field.size and traced.reads(group, one)]


def _given(group: list[Leaf], structure: str) -> list[Callable[[Builder], Value]]:
    """Return how each leaf of a group is read inside a function."""

    def reader(leaf: Leaf) -> Callable[[Builder], Value]:
        if leaf.fixed or leaf.field.size == 0:
            return lambda builder: Known(np.asarray(leaf.value))
        return lambda builder: value_of(builder, leaf.field, structure, leaf.dtype)

    return [reader(leaf) for leaf in group]


def _function(
    program: Program, tables: dict[Any, Table], inputs: Sequence[Callable[[Builder], Value]],
    results: Sequence[tuple[str, list[Leaf]]],
) -> Block:  # fmt: skip
    """Return the body of a function that ends by writing its results."""
    builder = Builder(tables)
    values = run(builder, program, [one(builder) for one in inputs])
    last: list[Any] = []
    targets = [(structure, leaf) for structure, group in results for leaf in group]
    for (structure, leaf), value in zip(targets, values, strict=True):
        place = f"{structure}->{leaf.field.name}"
        held = np.dtype(np.float64 if leaf.field.dtype == "real" else np.int32)
        if value.size == 0:
            continue
        if value.size <= SMALL:
            for k, one in enumerate(atoms(builder, value).elements):
                element = operation("cast", held, one)
                if not element.is_constant:
                    element = _fast(builder, element)
                target = place if leaf.field.shape == () else f"{place}[{k}]"
                last.append(Set(target, element, builder.line, external=True))
            continue
        array = stored(builder, value)
        if "->" in array.array and not array.array.startswith("inputs->"):
            if array.array == place:
                continue
            array = stored(builder, value, builder.array(value.dtype, value.size))
        if array.offset.terms or array.offset.constant or value.dtype != held:
            array = stored(builder, value, builder.array(held, value.size))
        last.append(Copy(place, array.array, array.size, builder.line, external=True))
    builder.line = ""
    for one in last:
        one.line = ""
        builder.add(one)
    block = builder.stack[0]
    drop_unused(block)
    join_single_uses(block)
    drop_unused(block)
    return block


def _fast(builder: Builder, element: Expression) -> Expression:
    """Return a name of a value that later writes to the caller's structures do not change."""
    bound = builder.bind(element)
    for one in builder.stack[0].statements:
        if isinstance(one, Assign) and one.name == bound.value:
            one.keep = True
            return bound
    return builder.bind(bound, keep=True)


def _shape(field: Field) -> str:
    return "" if field.shape == () else f"[{field.size}]"


def _declarations(printer: Printer, fields: Sequence[Field]) -> list[str]:
    lines = []
    for field in fields:
        kind = printer.real if field.dtype == "real" else "int32_t"
        notes = [field.text] if field.text else []
        if len(field.shape) > 1:
            notes.append(" x ".join(map(str, field.shape)) + ", last index fastest")
        note = comment("; ".join(notes) + (f" [{field.unit}]" if field.unit else ""))
        line = f"    {kind} {field.name}{_shape(field)};"
        if note and len(line) + len(note) >= WIDTH:
            # the end of a comment stays beside its last word
            whole = note.removesuffix(" */") + "\N{NO-BREAK SPACE}*/"
            rows = textwrap.wrap(whole, WIDTH - 4, initial_indent="    ",
                                 subsequent_indent="     * ")  # fmt: skip
            lines += [row.replace("\N{NO-BREAK SPACE}", " ") for row in (*rows, line)]
        else:
            lines.append(f"{line} {note}" if note else line)
    return lines or ["    char unused; /* C has no empty structures */"]


def _header(
    printer: Printer, law: str, sample_time: float, fields: Mapping[str, Sequence[Field]]
) -> str:
    prefix = printer.prefix
    what = {
        "parameters": "Gains and what follows from them; may be changed between steps.",
        "state": "All that evolves; belongs to the caller.",
        "inputs": "What is known at one sampling instant.",
        "outputs": "What a step gives.",
    }
    lines = [
        f"/* {law}: a control law of contourlab {contourlab.__version__}, sampled every "
        f"{float(sample_time)!r} s. Generated: do not edit. */",
        f"#ifndef {prefix.upper()}_H", f"#define {prefix.upper()}_H", "",
        "#include <stdint.h>", "",
        "#ifdef __cplusplus", 'extern "C" {', "#endif", "",
        f"typedef {printer.precision.c_type} {printer.real};", "",
    ]  # fmt: skip
    for name, text in what.items():
        lines += [f"/* {text} */", "typedef struct {", *_declarations(printer, fields[name]),
                  f"}} {prefix}_{name};", ""]  # fmt: skip
    lines += [
        "/* Sets the parameters to what they were when the law was exported. */",
        f"void {prefix}_default_parameters({prefix}_parameters *parameters);", "",
        "/* Sets the state before the first step; step is then called with the same inputs. */",
        f"void {prefix}_init(const {prefix}_parameters *parameters, "
        f"const {prefix}_inputs *inputs, {prefix}_state *state);", "",
        "/* One step: changes the state, gives the outputs. */",
        f"void {prefix}_step(const {prefix}_parameters *parameters, "
        f"const {prefix}_inputs *inputs, {prefix}_state *state, {prefix}_outputs *outputs);", "",
        "#ifdef __cplusplus", "}", "#endif", "", "#endif", "",
    ]  # fmt: skip
    return "\n".join(lines)


def _source(
    printer: Printer, law: str, tables: Mapping[Any, Table], texts: Mapping[str, list[str]],
    fields: Mapping[str, Sequence[Field]], defaults: Mapping[str, Any],
) -> str:  # fmt: skip
    prefix = printer.prefix
    body = "\n".join(line for text in texts.values() for line in text)
    lines = [
        f"/* {law}: a control law of contourlab {contourlab.__version__}. Generated: do not edit.",
        " * Comments name the line of the law that the statements below them come from.",
        " * Compile with -ffp-contract=off for the numbers that were tested. */",
        f'#include "{prefix}.h"', "", "#include <math.h>", "#include <stdbool.h>",
        "#include <string.h>", "",
    ]  # fmt: skip
    used = [one for one in tables.values() if f"{prefix}_{one.name}[" in body
            or f"{prefix}_{one.name}," in body]  # fmt: skip
    for table in used:
        lines += [*printer.table(table), ""]
    for name, (what, dtype) in sorted(printer.helpers.items()):
        lines.append(helper_text(name, what, dtype, printer.real, printer.precision))
    lines += [f"void {prefix}_default_parameters({prefix}_parameters *parameters)", "{"]
    for field in fields["parameters"]:
        flat = np.asarray(defaults[field.name]).ravel()
        for k, one in enumerate(flat):
            number = literal(one, flat.dtype, printer.precision)
            place = field.name if field.shape == () else f"{field.name}[{k}]"
            lines.append(f"    parameters->{place} = {number};")
    if not fields["parameters"]:
        lines.append("    parameters->unused = 0;")
    lines += ["}", ""]
    arguments = {
        "init": ["parameters", "inputs", "state"],
        "step": ["parameters", "inputs", "state", "outputs"],
    }
    for name, text in texts.items():
        own = "\n".join(text)
        given = []
        for argument in arguments[name]:
            constant = "const " if argument in ("parameters", "inputs") else ""
            given.append(f"{constant}{prefix}_{argument} *{argument}")
        lines += [f"void {prefix}_{name}({', '.join(given)})", "{"]
        lines += [f"    (void){one};" for one in arguments[name] if f"{one}->" not in own]
        lines += [*text, "}", ""]
    return "\n".join(lines)
