"""Generated C, compiled and called from Python: the very functions that run on the machine."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import ExportError
from contourlab.export.fields import Field
from contourlab.export.generate import GeneratedC
from contourlab.export.stack import stack_bytes
from contourlab.recordings.sample import Sample

__all__ = ["FLAGS", "CompiledController", "compile_c", "find_compiler", "write_sources"]

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
"""What the numbers of the tests were taken with."""


def find_compiler() -> str | None:
    """Return the C compiler: ``CC`` of the environment, or gcc, clang or cc; None without one."""
    named = os.environ.get("CC")
    for name in (named,) if named else ("gcc", "clang", "cc"):
        found = shutil.which(name)
        if found:
            return found
    return None


def write_sources(generated: GeneratedC, folder: str | Path) -> list[Path]:
    """Write header and source of a law and return their places.

    Parameters
    ----------
    generated
        The law.
    folder
        An existing folder.
    """
    files = []
    for ending, text in ((".h", generated.header), (".c", generated.source)):
        file = Path(folder) / f"{generated.prefix}{ending}"
        file.write_text(text, encoding="utf-8")
        files.append(file)
    return files


def compile_c(
    generated: GeneratedC, folder: str | Path, *, flags: Sequence[str] = FLAGS
) -> CompiledController:
    """Return a law compiled into a library of its own and loaded.

    Parameters
    ----------
    generated
        The law.
    folder
        Where sources and library go; an existing folder.
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
    *_, source = write_sources(generated, folder)
    library = Path(folder) / f"lib{generated.prefix}.so"
    command = [compiler, *flags, "-fPIC", "-shared", "-o", str(library), str(source), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ExportError(f"the C compiler refused the exported law: {done.stderr.strip()}")
    return CompiledController(generated, library, stack_bytes(generated, folder))


def _structure(fields: Sequence[Field], real: Any) -> Any:
    members: list[tuple[str, Any]] = []
    for field in fields:
        kind: Any = real if field.dtype == "real" else ctypes.c_int32
        members.append((field.name, kind * field.size if field.shape else kind))

    class Structure(ctypes.Structure):
        _fields_ = members or [("unused", ctypes.c_char)]

    return Structure


class CompiledController:
    """A compiled law with its state.

    Parameters
    ----------
    generated
        The law.
    library
        Made from it.
    stack
        What a call takes of the stack, if the compiler said so [bytes].
    """

    def __init__(
        self, generated: GeneratedC, library: str | Path, stack: int | None = None
    ) -> None:  # fmt: skip
        self.generated = generated
        self.stack = stack
        self.library = ctypes.CDLL(str(library))
        real = ctypes.c_float if generated.precision == "single" else ctypes.c_double
        self.parameters = _structure(generated.parameters, real)()
        self.state = _structure(generated.state, real)()
        self._inputs = _structure(generated.inputs, real)()
        self._outputs = _structure(generated.outputs, real)()
        prefix = generated.prefix
        self._init = getattr(self.library, f"{prefix}_init")
        self._step = getattr(self.library, f"{prefix}_step")
        getattr(self.library, f"{prefix}_default_parameters")(ctypes.byref(self.parameters))

    def set_parameters(self, **values: Any) -> None:
        """Change parameters.

        Parameters
        ----------
        **values
            By field name.
        """
        _fill(self.parameters, self.generated.parameters, values)

    def init(self, inputs: Sample | Mapping[str, Any]) -> None:
        """Set the state before the first step.

        Parameters
        ----------
        inputs
            A sample, or values by field name.
        """
        _fill(self._inputs, self.generated.inputs, self.named(inputs))
        self._init(*map(ctypes.byref, (self.parameters, self._inputs, self.state)))

    def step(self, inputs: Sample | Mapping[str, Any]) -> dict[str, NDArray[Any]]:
        """Return the outputs of one step by field name; changes the state.

        Parameters
        ----------
        inputs
            A sample, or values by field name.
        """
        _fill(self._inputs, self.generated.inputs, self.named(inputs))
        self._step(
            *map(ctypes.byref, (self.parameters, self._inputs, self.state, self._outputs))
        )  # fmt: skip
        return _read(self._outputs, self.generated.outputs)

    def rows(self, inputs: Mapping[str, Any]) -> Any:
        """Return many inputs as a C array of their structure.

        Parameters
        ----------
        inputs
            By field name, one row for each step.
        """
        n = len(next(iter(inputs.values()))) if inputs else 0
        rows = (type(self._inputs) * n)()
        view = _records(rows, self.generated.inputs)
        for field in self.generated.inputs:
            view[field.name] = np.asarray(inputs[field.name]).reshape(view[field.name].shape)
        return rows

    def replay(self, inputs: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
        """Return the outputs of many steps by field name, after an ``init`` with the first row.

        Parameters
        ----------
        inputs
            By field name, one row for each step.
        """
        rows = self.rows(inputs)
        n = len(rows)
        outs = (type(self._outputs) * n)()
        out = _records(outs, self.generated.outputs)
        if n:
            self._init(*map(ctypes.byref, (self.parameters, rows[0], self.state)))
        step, parameters, state = (
            self._step,
            ctypes.byref(self.parameters),
            ctypes.byref(self.state),
        )
        for k in range(n):
            step(parameters, ctypes.byref(rows[k]), state, ctypes.byref(outs[k]))
        return {
            field.name: np.array(out[field.name]).reshape(n, *field.shape)
            for field in self.generated.outputs
        }

    def state_values(self) -> dict[str, NDArray[Any]]:
        """Return the state by field name."""
        return _read(self.state, self.generated.state)

    def named(self, inputs: Sample | Mapping[str, Any]) -> Mapping[str, Any]:
        """Return inputs by field name.

        Parameters
        ----------
        inputs
            A sample, or values by field name already.
        """
        return named_inputs(self.generated.inputs, inputs)


def _records(structures: Any, fields: Sequence[Field]) -> Any:
    """Return an array of structures as a NumPy array of records on the same memory."""
    record = np.dtype(structures._type_)
    return np.frombuffer(structures, record, len(structures)) if fields else np.zeros(0, record)


def named_inputs(
    fields: Sequence[Field], inputs: Sample | Mapping[str, Any]
) -> Mapping[str, Any]:  # fmt: skip
    """Return inputs by field name.

    Parameters
    ----------
    fields
        Of the inputs.
    inputs
        A sample, or values by field name already.
    """
    if not isinstance(inputs, Sample):
        return inputs
    found: dict[str, Any] = {}
    for field in fields:
        value: Any = inputs
        for word in field.path.split("."):
            value = getattr(value, word)
        found[field.name] = np.asarray(value)
    return found


def _fill(structure: Any, fields: Sequence[Field], values: Mapping[str, Any]) -> None:
    unknown = set(values) - {field.name for field in fields}
    if unknown:
        raise ExportError(f"no field {sorted(unknown)[0]!r}")
    for field in fields:
        if field.name not in values:
            continue
        value = np.asarray(values[field.name])
        if field.shape == ():
            setattr(structure, field.name, value.reshape(()).item())
        else:
            target = np.ctypeslib.as_array(getattr(structure, field.name))
            target[:] = np.broadcast_to(value, field.shape).ravel()


def _read(structure: Any, fields: Sequence[Field]) -> dict[str, NDArray[Any]]:
    found = {}
    for field in fields:
        value = getattr(structure, field.name)
        array = np.array(value) if field.shape == () else np.ctypeslib.as_array(value).copy()
        found[field.name] = array.reshape(field.shape)
    return found
