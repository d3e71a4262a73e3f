"""LinuxCNC and HAL in namespaces of their own, so that nothing on the machine is touched.

LinuxCNC allows one HAL session per System V ipc namespace, loads components from one fixed folder,
and refuses to start as root. A private session solves all three: it runs in its own ipc, process
and mount namespaces, with a copy of the module folder that holds one's components mounted over the
installed one. Nothing is installed, several sessions run beside one another, and it works as root
and as a plain user (where the kernel lets users have namespaces, as Debian's does).

It is for simulation and tests: such a session has no real-time priority and no hardware.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from contourlab.errors import ContourlabError, RefusedError

__all__ = [
    "LINUXCNC_MODULES",
    "LINUXCNC_PYTHON",
    "LinuxcncError",
    "build_component",
    "missing_linuxcnc",
    "run_private",
]

LINUXCNC_MODULES = Path("/usr/lib/linuxcnc/modules")
"""Where Debian's LinuxCNC keeps its real-time modules."""
LINUXCNC_PYTHON = "/usr/bin/python3"
"""The interpreter that LinuxCNC's own modules are built for."""
NOBODY = 65534


class LinuxcncError(ContourlabError):
    """LinuxCNC, or one of its programs, failed; holds what it printed."""


def missing_linuxcnc() -> str | None:
    """Return what is missing for a private session, or None."""
    for program in ("linuxcnc", "halrun", "halcompile", "unshare"):
        if shutil.which(program) is None:
            return f"{program} is not installed"
    if not LINUXCNC_MODULES.is_dir():
        return f"there is no {LINUXCNC_MODULES}"
    probe = subprocess.run([*_namespaces(), "true"], capture_output=True, text=True, check=False)
    if probe.returncode != 0:
        return f"the kernel gives no namespaces: {probe.stderr.strip()}"
    return None


def build_component(component: Path) -> Path:
    """Return the module that ``halcompile`` made of a component, beside its source.

    Parameters
    ----------
    component
        A ``.comp`` file.

    Raises
    ------
    LinuxcncError
        It does not compile; holds the compiler's words.
    """
    run = subprocess.run(
        ["halcompile", "--compile", component.name],
        cwd=component.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    module = component.with_suffix(".so")
    if run.returncode != 0 or not module.is_file():
        raise LinuxcncError(f"halcompile refused {component}:\n{run.stdout}{run.stderr}")
    return module


def run_private(
    command: Sequence[str],
    *,
    modules: Sequence[Path],
    folder: Path,
    timeout: float,
    environment: Mapping[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    """Run a program in a private LinuxCNC session and return what it did.

    Parameters
    ----------
    command
        Program and arguments, such as ``("halrun", "-f", "test.hal")``.
    modules
        Compiled components that are to be found beside LinuxCNC's own.
    folder
        Working folder of the program.
    timeout
        After so long everything in the session is killed [s].
    environment
        Further variables.

    Raises
    ------
    RefusedError
        Something that a session needs is not there.
    LinuxcncError
        The session took longer than ``timeout``.
    """
    missing = missing_linuxcnc()
    if missing:
        raise RefusedError(f"no LinuxCNC session can be had: {missing}")
    with tempfile.TemporaryDirectory(prefix="hal", ignore_cleanup_errors=True) as name:
        session = Path(name)  # short, and open to all: a socket of another user's lies there
        session.chmod(0o1777)
        inside, variables = _prepared(session, command, modules)
        try:
            run = subprocess.run(
                [*_namespaces(), "sh", "-c", inside],
                cwd=folder,
                env={**variables, **(environment or {})},
                capture_output=True,
                text=True,
                timeout=timeout,
                check=False,
            )
            # where LinuxCNC's start script puts what went wrong
            reports = [session / f"linuxcnc_{kind}.txt" for kind in ("debug", "print")]
            told = [file.read_text(errors="replace") for file in reports if file.is_file()]
            return subprocess.CompletedProcess(
                run.args, run.returncode, run.stdout, "".join([run.stderr, *told])
            )
        except subprocess.TimeoutExpired as error:
            said = "".join(
                part.decode(errors="replace") if isinstance(part, bytes) else (part or "")
                for part in (error.stdout, error.stderr)
            )
            raise LinuxcncError(
                f"{shlex.join(map(str, command))} took longer than {timeout:g} s:\n{said[-4000:]}"
            ) from error


def _prepared(
    session: Path, command: Sequence[str], modules: Sequence[Path]
) -> tuple[str, dict[str, str]]:
    """Return the shell command that starts the session's program, and its environment."""
    own = session / "modules"
    shutil.copytree(LINUXCNC_MODULES, own, symlinks=True)
    for module in modules:
        shutil.copy(module, own / module.name)
    starter = session / "linuxcnc"  # LinuxCNC's start script, with a lock file of its own
    text = Path(str(shutil.which("linuxcnc"))).read_text()
    starter.write_text(text.replace("/tmp/linuxcnc.lock", str(session / "linuxcnc.lock")))
    starter.chmod(0o755)
    variables = {
        **{name: value for name, value in os.environ.items() if name != "DISPLAY"},
        "HOME": str(session),
        "RTAPI_FIFO_PATH": str(session / "rtapi_fifo"),
        "PATH": f"{session}{os.pathsep}{os.environ['PATH']}",
    }
    program = shlex.join(map(str, command))
    inside = f"mount --bind {shlex.quote(str(own))} {LINUXCNC_MODULES} && "
    if os.geteuid() == 0:
        variables["RTAPI_UID"] = str(NOBODY)
        return f"{inside}exec {program}", variables
    # back to who we were: LinuxCNC refuses to be root
    return f"{inside}exec unshare --user --map-user={os.geteuid()} -- {program}", variables


def _namespaces() -> list[str]:
    user = [] if os.geteuid() == 0 else ["--user", "--map-root-user"]
    own = ["--mount", "--ipc", "--pid", "--fork", "--mount-proc", "--kill-child"]
    return ["unshare", *user, *own, "--"]
