"""Any pure function of arrays as one C function that takes pointers: how whole loops are compiled.

The arguments are arrays, one pointer each, first those that go in, then those that come out, dense
and in C's order. What goes in must not overlap what comes out.
"""

from __future__ import annotations

import ctypes
import dataclasses
import re
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from contourlab.errors import ExportError
from contourlab.export.c_helpers import helper_text
from contourlab.export.compiled import FLAGS, find_compiler
from contourlab.export.expressions import Index, load, operation
from contourlab.export.flatten import flatten
from contourlab.export.optimise import drop_unused, join_single_uses
from contourlab.export.primitives.emission import run
from contourlab.export.printing import Printer
from contourlab.export.scalar_types import Precision, c_type, supported
from contourlab.export.statements import Builder, Copy, Store
from contourlab.export.values import SMALL, Atoms, Known, Stored, Value, indices, stored

__all__ = ["CFunction", "compile_function", "function_source"]


@dataclasses.dataclass(frozen=True)
class CFunction:
    """A function as C text.

    Parameters
    ----------
    name
        Of the function.
    source
        Of the file.
    inputs, outputs
        Shape and NumPy type of each array.
    structure
        Of the pytree that comes out.
    """

    name: str
    source: str
    inputs: tuple[tuple[tuple[int, ...], Any], ...]
    outputs: tuple[tuple[tuple[int, ...], Any], ...]
    structure: Any


def function_source(
    function: Callable[..., Any], *arguments: Any, name: str = "f", precision: str = "double"
) -> CFunction:
    """Return a function as C.

    Parameters
    ----------
    function
        Pure, of pytrees of arrays.
    *arguments
        Examples; only shapes and types matter.
    name
        Of the C function.
    precision
        ``"double"`` or ``"single"``.

    Raises
    ------
    ExportError
        It uses what cannot be exported.
    """
    leaves, inside = jax.tree.flatten(arguments)
    leaves = [np.asarray(one) for one in leaves]
    shown: list[Any] = []

    def flat(*given: Any) -> Any:
        out = function(*jax.tree.unflatten(inside, given))
        found, structure = jax.tree.flatten(out)
        shown[:] = [structure]
        return found

    closed = jax.make_jaxpr(flat)(*leaves)
    program = flatten(closed)
    builder, printer = Builder({}), Printer(name, Precision(precision))
    inputs = [(tuple(one.shape), np.dtype(one.dtype)) for one in closed.in_avals]
    outputs = [(tuple(one.shape), np.dtype(one.dtype)) for one in closed.out_avals]
    for _, kind in (*inputs, *outputs):
        if not supported(kind):
            raise ExportError(f"arrays of type {kind} cannot be exported")
    values = run(
        builder, program, [_argument(builder, f"x{k}", *one) for k, one in enumerate(inputs)]
    )
    for k, value in enumerate(values):
        _write(builder, f"y{k}", value)
    block = builder.stack[0]
    wanted = {f"y{k}" for k in range(len(values))}
    drop_unused(block, wanted)
    join_single_uses(block)
    drop_unused(block, wanted)
    body = printer.block(block)
    lines = ["#include <math.h>", "#include <stdbool.h>", "#include <stdint.h>",
             "#include <string.h>", "",
             f"typedef {printer.precision.c_type} {printer.real};", ""]  # fmt: skip
    text = "\n".join(body)
    for table in builder.tables.values():
        if f"{name}_{table.name}[" in text or f"{name}_{table.name}," in text:
            lines += printer.table(table)
    for label, (what, dtype) in sorted(printer.helpers.items()):
        lines.append(helper_text(label, what, dtype, printer.real, printer.precision))
    given = [f"const {c_type(t, printer.real)} *x{k}" for k, (_, t) in enumerate(inputs)]
    given += [f"{c_type(t, printer.real)} *y{k}" for k, (_, t) in enumerate(outputs)]
    lines += [f"void {name}({', '.join(given) or 'void'});",
              f"void {name}({', '.join(given) or 'void'})", "{"]  # fmt: skip
    names = [*(f"x{k}" for k in range(len(inputs))), *(f"y{k}" for k in range(len(outputs)))]
    lines += [f"    (void){one};" for one in names if not re.search(rf"\b{one}\b", text)]
    lines += [*body, "}", ""]
    return CFunction(name, "\n".join(lines), tuple(inputs), tuple(outputs), shown[0])


def _argument(builder: Builder, label: str, shape: tuple[int, ...], dtype: Any) -> Value:
    size = int(np.prod(shape, dtype=int))
    if size == 0:
        return Known(np.zeros(shape, dtype))
    if size > SMALL:
        return Stored(shape, dtype, label)
    elements = [builder.bind(load(label, Index(k), dtype)) for k in range(size)]
    return Atoms(builder, shape, dtype, elements)


def _write(builder: Builder, label: str, value: Value) -> None:
    if value.size == 0:
        return
    if value.size <= SMALL:
        for k, at in enumerate(indices(value.shape)):
            element = operation("cast", value.dtype, value.at(builder, at))
            builder.add(Store(label, Index(k), builder.bind(element), builder.line))
        return
    array = stored(builder, value)
    if array.offset != Index():
        stored(builder, value, label)
    else:
        builder.add(Copy(label, array.array, array.size, builder.line))


def compile_function(
    made: CFunction, folder: str | Path, *, flags: Sequence[str] = FLAGS
) -> Callable[..., Any]:
    """Return a C function, compiled and loaded, that takes and returns what the original does.

    Parameters
    ----------
    made
        As :func:`function_source` returned it.
    folder
        Where source and library go; an existing folder.
    flags
        Of the compiler.

    Raises
    ------
    ExportError
        There is no compiler, or it refuses.
    """
    compiler = find_compiler()
    if compiler is None:
        raise ExportError("no C compiler was found: install gcc or clang, or name one in CC")
    source, library = Path(folder) / f"{made.name}.c", Path(folder) / f"{made.name}.so"
    source.write_text(made.source)
    command = [compiler, *flags, "-fPIC", "-shared", "-o", str(library), str(source), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ExportError(f"the C compiler refused: {done.stderr.strip()}")
    entry = getattr(ctypes.CDLL(str(library)), made.name)

    def call(*arguments: Any) -> Any:
        leaves = [
            np.ascontiguousarray(one, dtype)
            for one, (_, dtype) in zip(jax.tree.leaves(arguments), made.inputs, strict=True)
        ]
        results = [np.zeros(shape, dtype) for shape, dtype in made.outputs]
        entry(*(one.ctypes.data_as(ctypes.c_void_p) for one in (*leaves, *results)))
        return jax.tree.unflatten(made.structure, results)

    return call
