"""Target ``fmu``: an exported law as a functional mock-up unit for co-simulation.

FMI 3.0 or FMI 2.0, compiled for this platform, with its sources. Every number of the law is a
variable: inputs, outputs and telemetry, and gains as tunable parameters. One communication step is
one sample of the law: it takes the inputs of the step's start and gives the command that acts until
its end. A step of another length is an error, and so is a command that is not finite.

The numbers are those of the same C called in any other way: the law's functions are hidden inside
the library and bound to each other (a function of the C library that happens to have the same name
would else be called in its place), and compiled without fused multiply-adds.
"""

from __future__ import annotations

import hashlib
import platform
import sys
import tempfile
import xml.sax.saxutils
import zipfile
from pathlib import Path
from typing import Any

import contourlab
from contourlab.errors import ConfigurationError, OutputError, RefusedError
from contourlab.export.fmu_functions import MISSING_IN_FMI2, MISSING_IN_FMI3
from contourlab.export.fmu_variables import Variable, ranges_of, variables_of
from contourlab.export.generate import GeneratedC
from contourlab.export.golden import RecordedLoop
from contourlab.export.parity import Parity
from contourlab.export.shared_library import compile_library
from contourlab.export.templating import render
from contourlab.recordings.files import atomic_file, refuse_existing

__all__ = ["FMI_VERSIONS", "fmu_files", "refuse", "write", "write_fmu"]

FMI_VERSIONS = (2, 3)
TOOL = 'generationTool="contourlab '


def fmu_files(generated: GeneratedC, fmi: int = 3) -> dict[str, str]:
    """Return the text files of a functional mock-up unit, by their place in the archive.

    Parameters
    ----------
    generated
        The exported law.
    fmi
        2 or 3.
    """
    prefix = generated.prefix
    ranges = ranges_of(generated)
    variables = list(variables_of(generated, ranges))
    compiled = [f"{prefix}.c", f"{prefix}_fmi{fmi}.c"]
    time = next((field.name for field in generated.inputs if field.path == "time"), "")
    values: dict[str, Any] = {
        "P": prefix,
        "n": next(field.size for field in generated.outputs if field.name == "command"),
        "version": contourlab.__version__,
        "description": f"{generated.law}, sampled every {float(generated.sample_time)!r} s",
        "sample_time": repr(float(generated.sample_time)),
        "time_field": time,
        "ranges": ranges,
        "compiled": compiled,
        "variables": [_escaped(variable) for variable in variables],
        "units": sorted({_quoted(v.unit) for v in variables if v.unit and not v.whole}),
        "missing2": MISSING_IN_FMI2,
        "missing3": MISSING_IN_FMI3,
        "token": "",
    }
    described = f"modelDescription{fmi}.xml.j2"
    names = "".join(render(f"fmu/{described}", values))
    digest = hashlib.sha256((generated.header + generated.source + names).encode()).hexdigest()
    values["token"] = "{" + "-".join(digest[a:b] for a, b in _GUID) + "}"
    files = {
        "modelDescription.xml": render(f"fmu/{described}", values),
        f"sources/{prefix}.h": generated.header,
        f"sources/{prefix}.c": generated.source,
        f"sources/{prefix}_instance.h": render("fmu/instance.h.j2", values),
        f"sources/{prefix}_fmi{fmi}.c": render(f"fmu/fmi{fmi}.c.j2", values),
    }
    if fmi == 3:
        files["sources/buildDescription.xml"] = render("fmu/buildDescription.xml.j2", values)
    return files


def refuse(output: Path, *, force: bool, fmi: int = 3) -> None:
    """Raise if a unit cannot be written there.

    Parameters
    ----------
    output
        The file.
    force
        Whether a unit that contourlab made may be replaced.
    fmi
        2 or 3.

    Raises
    ------
    ConfigurationError
        Another version.
    OutputError
        The file exists already, or is not one of ours.
    """
    if fmi not in FMI_VERSIONS:
        raise ConfigurationError(f"fmi must be 2 or 3, got {fmi!r}")
    refuse_existing(output, force=force)
    if output.exists() and not _is_ours(output):
        raise OutputError(
            f"{output} was not made by contourlab export --target fmu; it stays as it is, "
            "choose another name"
        )


def write(
    generated: GeneratedC, loop: RecordedLoop, output: Path, parity: Parity | None, *,
    force: bool, fmi: int = 3,
) -> list[str]:  # fmt: skip
    """Write the file of target ``fmu`` and return the names inside it.

    Parameters
    ----------
    generated
        The law.
    loop, parity
        Not used: a unit holds no golden data.
    output
        The file.
    force
        Whether a unit that contourlab made may be replaced.
    fmi
        2 or 3.
    """
    del loop, parity
    return list(write_fmu(generated, output, fmi=fmi, force=force))


_GUID = ((0, 8), (8, 12), (12, 16), (16, 20), (20, 32))


def write_fmu(
    generated: GeneratedC,
    file: str | Path,
    *,
    fmi: int = 3,
    force: bool = False,
) -> tuple[str, ...]:
    """Write a functional mock-up unit, atomically, and return the names inside it.

    Parameters
    ----------
    generated
        The exported law.
    file
        Where, usually ``.fmu``.
    fmi
        2 or 3.
    force
        Whether a unit that contourlab made may be replaced; nothing else is.

    Raises
    ------
    OutputError
        The file exists already, or is not one of ours.
    ExportError
        There is no C compiler, or it refuses.
    """
    target = Path(file)
    refuse(target, force=force, fmi=fmi)
    with atomic_file(target, force=force) as temporary, tempfile.TemporaryDirectory() as folder:
        files = fmu_files(generated, fmi)
        for name, text in files.items():
            place = Path(folder) / name
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(text)
        prefix = generated.prefix
        sources = [Path(folder) / f"sources/{prefix}{end}.c" for end in ("", f"_fmi{fmi}")]
        binary, inside = binary_place(prefix, fmi)
        library = compile_library(
            sources,
            Path(folder) / binary,
            flags=("-fvisibility=hidden", *(() if sys.platform == "darwin" else _BOUND)),
        )
        with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, text in sorted(files.items()):
                archive.writestr(zipfile.ZipInfo(name, _EPOCH), text, zipfile.ZIP_DEFLATED)
            archive.writestr(
                zipfile.ZipInfo(inside, _EPOCH), library.read_bytes(), zipfile.ZIP_DEFLATED
            )
    return (*sorted(files), inside)


_BOUND = ("-Wl,-Bsymbolic",)
_EPOCH = (2000, 1, 1, 0, 0, 0)
"""One time for all files: the same law gives the same archive."""


def binary_place(prefix: str, fmi: int) -> tuple[str, str]:
    """Return the library's file name, and its place in the archive, on this platform.

    Parameters
    ----------
    prefix
        Of the law.
    fmi
        2 or 3.

    Raises
    ------
    RefusedError
        A platform that the standard has no name for.
    """
    systems = {
        "linux": ("linux", ".so"),
        "darwin": ("darwin", ".dylib"),
        "win32": ("windows", ".dll"),
    }
    machines = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}
    machine = machines.get(platform.machine().lower())
    if sys.platform not in systems or machine is None:
        raise RefusedError(
            f"FMI has no name for the platform {sys.platform} on {platform.machine()}"
        )
    system, ending = systems[sys.platform]
    folder = f"{machine}-{system}"
    if fmi == 2:
        if machine != "x86_64":
            raise RefusedError(
                f"FMI 2.0 has no name for binaries on {platform.machine()}: take --fmi 3"
            )
        folder = {"linux": "linux64", "darwin": "darwin64", "windows": "win64"}[system]
    return f"{prefix}{ending}", f"binaries/{folder}/{prefix}{ending}"


def _is_ours(file: Path) -> bool:
    try:
        with zipfile.ZipFile(file) as archive:
            return TOOL.encode() in archive.read("modelDescription.xml")
    except (OSError, KeyError, zipfile.BadZipFile):
        return False


def _quoted(text: str) -> str:
    return xml.sax.saxutils.escape(text, {'"': "&quot;"})


_KINDS = {
    "inputs": 'causality="input" variability="continuous"',  # sampled here, once in every step
    "outputs": 'causality="output" variability="discrete" initial="exact"',
    "parameters": 'causality="parameter" variability="tunable"',
}


def _escaped(variable: Variable) -> dict[str, Any]:
    kind = _KINDS[variable.group]
    return {
        "kind": kind.replace("continuous", "discrete") if variable.whole else kind,
        "reference": variable.reference,
        "name": _quoted(variable.name),
        "group": variable.group,
        "whole": variable.whole,
        "unit": _quoted(variable.unit),
        "start": variable.start,
        "description": _quoted(variable.description),
    }
