"""The servo layer of a LinuxCNC component, called from Python: the very C of the component.

It serves to try a component on a desk, to test what it does with NaN and trips, and to replay a log
of the real machine: the logged inputs must give the logged commands, bit for bit.
"""

from __future__ import annotations

import ctypes
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import ExportError
from contourlab.export.fields import Field
from contourlab.export.folder import MANIFEST
from contourlab.export.generate import GeneratedC
from contourlab.export.law_facts import LawFacts
from contourlab.export.linuxcnc import LinuxcncOptions, linuxcnc_files
from contourlab.export.shared_library import compile_library
from contourlab.export.templating import render

__all__ = ["FAULTS", "ServoLayer"]

FAULTS = (
    "none",
    "input not finite",
    "following error",
    "command not finite",
    "wrong thread period",
    "bad setting",
)
"""What each fault code means."""


class ServoLayer:
    """A servo layer, compiled; it remembers its state from one call to the next.

    Parameters
    ----------
    folder
        With the files of target ``linuxcnc``.
    prefix
        Of their names.
    n_axes
        Number of axes.
    precision
        ``"double"`` or ``"single"``.
    parameters, inputs, outputs
        Fields of the law's structures.

    Raises
    ------
    ExportError
        There is no C compiler, or it lays out structures in a way of its own.
    """

    settings: NDArray[Any]
    """A structured array without dimensions: ``scale``, ``command_limit``, ``law`` and so on."""

    def __init__(
        self, folder: Path, *, prefix: str, n_axes: int, precision: str,
        parameters: Sequence[Field], inputs: Sequence[Field], outputs: Sequence[Field],
    ) -> None:  # fmt: skip
        with tempfile.TemporaryDirectory() as place:
            desk = Path(place) / f"{prefix}_desk.c"
            desk.write_text(render("linuxcnc/desk.c.j2", {"P": prefix}))
            sources = [folder / f"{prefix}.c", folder / f"{prefix}_servo.c", desk]
            library = Path(place) / f"lib{prefix}_desk.so"
            compile_library(sources, library, flags=(f"-I{folder}",))
            self._library = ctypes.CDLL(str(library))
        self._run = getattr(self._library, f"{prefix}_desk_run")
        self._run.restype = None
        types = _types(n_axes, precision, parameters, inputs, outputs)
        size = getattr(self._library, f"{prefix}_desk_size")
        size.restype = ctypes.c_size_t
        for which, of in enumerate(types):
            if size(which) != of.itemsize:
                raise ExportError(
                    f"the compiler lays structures out in another way than NumPy ({size(which)} "
                    f"and {of.itemsize} bytes): replaying in Python is not possible here"
                )
        self.inputs_type, self._outputs_type = types[1], types[2]
        self.settings = np.zeros((), types[0])
        getattr(self._library, f"{prefix}_servo_defaults")(_address(self.settings))
        self._start = getattr(self._library, f"{prefix}_servo_start")
        self._state = np.zeros(size(3), np.uint8)
        self.restart()

    @staticmethod
    def of_export(folder: str | Path) -> ServoLayer:
        """Return the servo layer of an exported component.

        Parameters
        ----------
        folder
            That ``export --target linuxcnc`` wrote.

        Raises
        ------
        ExportError
            It is not such a folder; or as for the class.
        """
        place = Path(folder)
        try:
            known = json.loads((place / MANIFEST).read_text())
            fields = {
                group: [
                    Field(f["name"], tuple(f["shape"]), f["unit"], f["type"], f["path"])
                    for f in known[group]
                ]
                for group in ("parameters", "inputs", "outputs")
            }
            n_axes = int(known["linuxcnc"]["n_axes"])
            return ServoLayer(
                place, prefix=known["prefix"], n_axes=n_axes, precision=known["precision"], **fields
            )
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ExportError(
                f"{folder} is not a folder that export --target linuxcnc wrote ({error})"
            ) from error

    @staticmethod
    def made(
        generated: GeneratedC, facts: LawFacts, options: LinuxcncOptions, folder: Path
    ) -> ServoLayer:
        """Return the servo layer of a law, its files written into a folder.

        Parameters
        ----------
        generated
            The exported law.
        facts
            What it commands and asks for.
        options
            What the user says about the machine.
        folder
            Where the files go; made if it is missing.
        """
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in linuxcnc_files(generated, facts, options).items():
            (folder / name).write_text(text)
        return ServoLayer(
            folder, prefix=generated.prefix, n_axes=facts.n_axes, precision=generated.precision,
            parameters=generated.parameters, inputs=generated.inputs, outputs=generated.outputs,
        )  # fmt: skip

    def restart(self) -> None:
        """Forget everything, as when the component is loaded."""
        self._start(_address(self._state))

    def inputs(self, n_cycles: int, period: float) -> NDArray[Any]:
        """Return inputs to fill: all zero, disabled.

        Parameters
        ----------
        n_cycles
            Number of servo cycles.
        period
            Of the thread [s].
        """
        rows = np.zeros(n_cycles, self.inputs_type)
        rows["period"] = period
        return rows

    def run(self, inputs: NDArray[Any]) -> NDArray[Any]:
        """Return what the component would have put out in each servo cycle.

        Parameters
        ----------
        inputs
            As :meth:`inputs` makes them.

        Returns
        -------
        NDArray
            One row a cycle: ``command``, ``following_error``, ``running``, ``fault``,
            ``saturated``, and what the law was given and returned (``law_inputs``, ``law``).
        """
        rows = np.ascontiguousarray(inputs, self.inputs_type)
        out = np.zeros(len(rows), self._outputs_type)
        self._run(
            _address(self.settings),
            _address(self._state),
            ctypes.c_size_t(len(rows)),
            _address(rows),
            _address(out),
        )
        return out


def _address(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _types(
    n: int, precision: str, parameters: Sequence[Field], given: Sequence[Field],
    returned: Sequence[Field],
) -> tuple[np.dtype[Any], ...]:  # fmt: skip
    """Return the layout of settings, inputs and outputs."""
    real = np.float64 if precision == "double" else np.float32

    def struct(fields: Sequence[Field]) -> np.dtype[Any]:
        columns: list[Any] = [
            (f.name, real if f.dtype == "real" else np.int32, f.shape) for f in fields
        ]
        return np.dtype(columns or [("unused", np.int8)], align=True)

    vector = (np.float64, (n,))
    settings = [
        ("scale", *vector),
        ("command_limit", *vector),
        ("following_error_limit", *vector),
        ("hold_speed", np.float64),
        ("minimum_radius", np.float64),
        ("measured_velocity", np.int32),
        ("law", struct(parameters)),
    ]
    inputs = [
        ("period", np.float64),
        ("reference_position", *vector),
        ("reference_velocity", *vector),
        ("reference_acceleration", *vector),
        ("position", *vector),
        ("velocity", *vector),
        ("enable", np.int32),
    ]
    outputs = [
        ("command", *vector),
        ("following_error", *vector),
        ("running", np.int32),
        ("fault", np.int32),
        ("saturated", np.int32),
        ("reserved", np.int32),
        ("law_inputs", struct(given)),
        ("law", struct(returned)),
    ]
    return tuple(np.dtype(columns, align=True) for columns in (settings, inputs, outputs))
