"""How much stack an exported law takes: as the compiler says, or what its arrays make.

All that a step keeps for itself lies on the stack: a law that solves a program in each step keeps
hundreds of kilobytes there, and threads in real time often have few. gcc and clang write what each
function takes (``-fstack-usage``). The functions of a law do not call themselves, so that no call
takes more than the largest of those that are called from outside and all others together.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

from contourlab.export.generate import GeneratedC

__all__ = ["STACK_FLAG", "array_bytes", "says_stack", "stack_bytes"]

STACK_FLAG = "-fstack-usage"

_SIZES = {"int32_t": 4, "int64_t": 8, "uint32_t": 4, "bool": 1}
_ARRAY = re.compile(r"^ +(\w+) \w+\[(\d+)\]( = .*)?;", re.MULTILINE)


def says_stack(compiler: str) -> bool:
    """Return whether a compiler knows the flag that makes it say what functions take.

    Parameters
    ----------
    compiler
        Its name or path.
    """
    done = subprocess.run(
        [compiler, STACK_FLAG, "-E", "-x", "c", "-"], input="", capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    return done.returncode == 0


def stack_bytes(generated: GeneratedC, folder: str | Path) -> int | None:
    """Return what a call takes at the most, functions of libm apart; None if nothing says so.

    Parameters
    ----------
    generated
        The law.
    folder
        Where it was compiled with ``STACK_FLAG``.
    """
    outside = {f"{generated.prefix}_{name}" for name in ("default_parameters", "init", "step")}
    called, others = [], 0
    for file in Path(folder).glob("*.su"):
        for line in file.read_text().splitlines():
            where, size, kind = line.split("\t")
            if "static" not in kind and "bounded" not in kind:
                return None
            name = where.rpartition(":")[2]
            if name in outside:
                called.append(int(size))
            else:
                others += int(size)
    return max(called) + others if called else None


def array_bytes(generated: GeneratedC) -> int:
    """Return what the arrays of a step take: most of its stack, where no compiler says more.

    Parameters
    ----------
    generated
        The law.
    """
    step = generated.source.partition(f"void {generated.prefix}_step(")[2]
    real = 4 if generated.precision == "single" else 8
    return sum(_SIZES.get(kind, real) * int(n) for kind, n, _ in _ARRAY.findall(step))
