"""A folder of C: the law, an example, its golden data with a program that replays them, a Makefile.

The texts are templates beside this file.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray

import contourlab
from contourlab.export.compiled import FLAGS, write_sources
from contourlab.export.fields import Field
from contourlab.export.folder import MANIFEST, SCHEMA
from contourlab.export.generate import GeneratedC
from contourlab.export.golden import RecordedLoop
from contourlab.export.parity import Parity, unmeasured_bound
from contourlab.export.stack import array_bytes

__all__ = ["GOLDEN", "write_c", "write_golden", "write_manifest"]

GOLDEN = "golden.csv"

STRICT = "-Wall -Wextra -Werror -pedantic"
SANITIZERS = "-fsanitize=address,undefined -fno-sanitize-recover=all"


def write_c(
    generated: GeneratedC, loop: RecordedLoop, folder: Path, parity: Parity | None
) -> list[str]:
    """Write the files of target ``c`` and return their names.

    Parameters
    ----------
    generated
        The law.
    loop
        In which it was recorded.
    folder
        An empty one.
    parity
        What its replay here showed; None where there was no compiler.
    """
    files = [one.name for one in write_sources(generated, folder)]
    write_golden(generated, loop, folder / GOLDEN)
    prefix = generated.prefix
    facts = {
        "g": generated, "P": prefix, "version": contourlab.__version__, "loop": loop,
        "bound": unmeasured_bound(generated) if parity is None else parity.bound,
        "parity": parity, "golden": GOLDEN,
        "flags": " ".join(FLAGS), "strict": STRICT, "sanitizers": SANITIZERS,
        "state_bytes": size_of(generated, generated.state),
        "parameter_bytes": size_of(generated, generated.parameters),
        "bounds": _bounds(generated, parity),
        "outputs": {one.name: one for one in generated.outputs},
        "array_bytes": array_bytes(generated),
        "n_axes": next(f.size for f in generated.outputs if f.name == "command"),
    }  # fmt: skip
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("contourlab.export"), undefined=jinja2.StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    environment.filters["shape"] = _shape_text
    environment.filters["cell"] = lambda text: text.replace("|", "\\|")
    for template, name in (
        ("main.c.jinja", "main.c"), ("replay.c.jinja", f"{prefix}_replay.c"),
        ("Makefile.jinja", "Makefile"), ("README.md.jinja", "README.md"),
    ):  # fmt: skip
        text = environment.get_template(template).render(facts)
        (folder / name).write_text(text, encoding="utf-8")
        files.append(name)
    files += [GOLDEN, MANIFEST]
    write_manifest(generated, folder, "c", files, parity)
    return files


def _bounds(generated: GeneratedC, parity: Parity | None) -> dict[str, float]:
    """Return the bound of every real output, the command first."""
    names = [one.name for one in generated.outputs if one.dtype != "int32"]
    names.sort(key=lambda name: name != "command")
    if parity is None:
        return dict.fromkeys(names, unmeasured_bound(generated).relative)
    known = {one.name: one.bound.relative for one in parity.telemetry}
    return {name: known.get(name, parity.bound.relative) for name in names}


def size_of(generated: GeneratedC, fields: tuple[Field, ...]) -> int:
    """Return the bytes of a structure, without padding.

    Parameters
    ----------
    generated
        The law.
    fields
        Of the structure.
    """
    real = 4 if generated.precision == "single" else 8
    return sum(one.size * (real if one.dtype == "real" else 4) for one in fields)


def _shape_text(field: Field) -> str:
    return " x ".join(map(str, field.shape)) or "1"


def write_golden(generated: GeneratedC, loop: RecordedLoop, file: Path) -> None:
    """Write inputs and outputs of a loop as a table: one row for each step, 17 digits.

    Parameters
    ----------
    generated
        The law.
    loop
        What to write.
    file
        Where.
    """
    inputs = loop.inputs(generated.inputs)
    columns: list[NDArray[Any]] = []
    names: list[str] = []
    for fields, values in (
        (generated.inputs, inputs),
        (generated.outputs, {one.name: loop.outputs[one.path] for one in generated.outputs}),
    ):
        for field in fields:
            rows = np.asarray(values[field.name], float).reshape(loop.n_steps, -1)
            columns.append(rows)
            count = rows.shape[1]
            own = [field.name] if field.shape == () else [
                f"{field.name}[{k}]" for k in range(count)
            ]  # fmt: skip
            names += own
    np.savetxt(
        file, np.concatenate(columns, axis=1), fmt="%.17g", delimiter=",",
        header=",".join(names), comments="",
    )  # fmt: skip


def write_manifest(
    generated: GeneratedC, folder: Path, target: str, files: list[str], parity: Parity | None,
    **more: Any,
) -> None:  # fmt: skip
    """Write the manifest that marks a folder as an export and says what is in it.

    Parameters
    ----------
    generated
        The law.
    folder
        Where.
    target
        Of the export.
    files
        Names of all files.
    parity
        What a replay showed; None where there was no compiler.
    **more
        What else is to be said of a target.
    """

    def described(fields: tuple[Field, ...]) -> list[dict[str, Any]]:
        return [
            {"name": f.name, "shape": list(f.shape), "unit": f.unit, "type": f.dtype,
             "path": f.path, "text": f.text}
            for f in fields
        ]  # fmt: skip

    bound = unmeasured_bound(generated) if parity is None else parity.bound
    content = {
        "schema": SCHEMA, "contourlab": contourlab.__version__, "target": target,
        "law": generated.law, "prefix": generated.prefix, "precision": generated.precision,
        "sample_time": generated.sample_time, "operations": generated.operations,
        "operations_once": generated.operations_once,
        "statuses": list(generated.statuses), "files": sorted(files),
        "state_bytes": size_of(generated, generated.state),
        "stack_bytes": None if parity is None else parity.stack,
        "array_bytes": array_bytes(generated),
        "parameters": described(generated.parameters), "state": described(generated.state),
        "inputs": described(generated.inputs), "outputs": described(generated.outputs),
        "parity_bound": {"relative": bound.relative, "reason": bound.reason},
        "parity": None if parity is None else parity_json(parity), **more,
    }  # fmt: skip
    (folder / MANIFEST).write_text(json.dumps(content, indent=1) + "\n")


def parity_json(parity: Parity) -> dict[str, Any]:
    """Return a parity as it stands in JSON.

    Parameters
    ----------
    parity
        What a replay showed.
    """
    return {
        "relative": parity.relative, "difference": parity.difference, "peak": parity.peak,
        "steps": parity.steps, "bound": parity.bound.relative, "reason": parity.bound.reason,
        "holds": parity.holds,
        "telemetry": [
            {"name": one.name, "relative": one.relative, "difference": one.difference,
             "peak": one.peak, "bound": one.bound.relative, "reason": one.bound.reason,
             "holds": one.holds}
            for one in parity.telemetry
        ],
        "flipped": [
            {"step": k, "output": name, "expected": a, "exported": b}
            for k, name, a, b in parity.flipped
        ],
    }  # fmt: skip
