"""A jaxpr as one list of equations: calls are opened, what does nothing is left out.

A jaxpr nests: ``jit``, ``custom_jvp`` and the like hold jaxprs of their own. Here they become their
equations, so that it is known how often every variable is used. Bodies of loops and branches stay
programs of their own. Every equation keeps the line of the law that it came from; equations inside
functions of JAX itself have the line of their caller.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections import Counter
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.extend import core

from contourlab.export.scalar_types import supported
from contourlab.export.values import Known

__all__ = ["Equation", "Program", "Variable", "flatten"]

_CALLS = {
    "jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call",
    "custom_vjp_call_jaxpr", "remat", "remat2", "checkpoint", "custom_lin", "run_state",
}  # fmt: skip
_IDENTITIES = {"stop_gradient", "copy", "copy_p", "optimization_barrier", "pvary"}
_JAX = str(Path(jax.__file__).parent)
_HERE = str(Path(__file__).parents[1])


@dataclasses.dataclass(frozen=True, eq=False)
class Variable:
    """One value of a program, by identity."""

    shape: tuple[int, ...]
    dtype: Any


Atom = Variable | Known


@dataclasses.dataclass(eq=False)
class Equation:
    """One operation."""

    primitive: str
    inputs: tuple[Atom, ...]
    outputs: tuple[Variable, ...]
    params: dict[str, Any]
    line: str
    """Of the law: file and number."""


@dataclasses.dataclass(eq=False)
class Program:
    """Equations in order, with what goes in and comes out."""

    inputs: tuple[Variable, ...]
    equations: list[Equation]
    outputs: tuple[Atom, ...]

    def uses(self) -> Counter[Variable]:
        """Return how often each variable is used."""
        count: Counter[Variable] = Counter()
        for equation in self.equations:
            count.update(one for one in equation.inputs if isinstance(one, Variable))
        count.update(one for one in self.outputs if isinstance(one, Variable))
        return count

    def consumers(self) -> dict[Variable, list[Equation | None]]:
        """Return which equations use each variable; None stands for the outputs."""
        found: dict[Variable, list[Equation | None]] = {}
        for equation in self.equations:
            for one in equation.inputs:
                if isinstance(one, Variable):
                    found.setdefault(one, []).append(equation)
        for one in self.outputs:
            if isinstance(one, Variable):
                found.setdefault(one, []).append(None)
        return found


def flatten(closed: Any) -> Program:
    """Return the program of a closed jaxpr.

    Parameters
    ----------
    closed
        As ``jax.make_jaxpr`` returns it.
    """
    return _program(closed.jaxpr, closed.consts, "")


def _program(jaxpr: Any, consts: Any, line: str) -> Program:
    env: dict[Any, Atom] = {}
    for variable, value in zip(jaxpr.constvars, consts, strict=True):
        env[variable] = Known(np.asarray(value))
    inputs = tuple(_variable(one.aval) for one in jaxpr.invars)
    env.update(zip(jaxpr.invars, inputs, strict=True))
    equations: list[Equation] = []
    _open(jaxpr, env, equations, line)
    program = Program(inputs, equations, tuple(_read(env, one) for one in jaxpr.outvars))
    _drop_unused(program)
    return program


def _variable(aval: Any) -> Variable:
    return Variable(tuple(getattr(aval, "shape", ())), getattr(aval, "dtype", None))


def _read(env: dict[Any, Atom], one: Any) -> Atom:
    if isinstance(one, core.Literal):
        return Known(np.asarray(one.val, getattr(one.aval, "dtype", None)))
    return env[one]


def _open(jaxpr: Any, env: dict[Any, Atom], equations: list[Equation], caller: str) -> None:
    for eqn in jaxpr.eqns:
        primitive = eqn.primitive.name
        inputs = tuple(_read(env, one) for one in eqn.invars)
        line = caller or source_line(eqn)
        if primitive in _IDENTITIES or _keeps_type(primitive, eqn):
            env.update(zip(eqn.outvars, inputs, strict=True))
            continue
        if primitive in _CALLS:
            inner = _called(eqn.params)
            body = getattr(inner, "jaxpr", inner)
            consts = getattr(inner, "consts", ())
            scope: dict[Any, Atom] = {
                v: Known(np.asarray(c)) for v, c in zip(body.constvars, consts, strict=True)
            }  # fmt: skip
            scope.update(zip(body.invars, inputs, strict=True))
            _open(body, scope, equations, line if caller or _of_jax(body) else "")
            env.update(
                (out, _read(scope, one)) for out, one in zip(eqn.outvars, body.outvars, strict=True)
            )
            continue
        outputs = tuple(_variable(one.aval) for one in eqn.outvars)
        env.update(zip(eqn.outvars, outputs, strict=True))
        params = {key: _parameter(key, one, line) for key, one in eqn.params.items()}
        equations.append(Equation(primitive, inputs, outputs, params, line))


def _keeps_type(primitive: str, eqn: Any) -> bool:
    if primitive != "convert_element_type":
        return False
    return bool(eqn.invars[0].aval.dtype == eqn.outvars[0].aval.dtype)


def _called(params: dict[str, Any]) -> Any:
    for key in ("jaxpr", "call_jaxpr", "fun_jaxpr"):
        if key in params:
            return params[key]
    raise KeyError("a call without a jaxpr")


def _parameter(key: str, value: Any, line: str) -> Any:
    """Return a parameter of an equation; jaxprs of bodies and branches as programs."""
    inside = line if key in ("update_jaxpr", "jvp_jaxpr_fun") else ""
    if hasattr(value, "jaxpr") and hasattr(value, "consts"):
        return _program(value.jaxpr, value.consts, inside)
    if isinstance(value, tuple) and value and all(hasattr(one, "jaxpr") for one in value):
        return tuple(_program(one.jaxpr, one.consts, inside) for one in value)
    return value


def _of_jax(jaxpr: Any) -> bool:
    info = getattr(jaxpr, "debug_info", None)
    return _JAX in str(getattr(info, "func_src_info", ""))


def source_line(eqn: Any) -> str:
    """Return file and line of the law that an equation came from; never a machine's path.

    Parameters
    ----------
    eqn
        Of a jaxpr.
    """
    from jax._src import source_info_util

    frames = source_info_util.user_frames(eqn.source_info.traceback)
    for frame in itertools.islice(frames, 1):
        return f"{_shown(frame.file_name)}:{frame.start_line}"
    return ""


def _shown(file: str) -> str:
    path = Path(file)
    if path.is_relative_to(_HERE):
        return path.relative_to(_HERE).as_posix()
    return path.name


def _drop_unused(program: Program) -> None:
    needed = {one for one in program.outputs if isinstance(one, Variable)}
    kept = []
    for equation in reversed(program.equations):
        if any(out in needed for out in equation.outputs):
            needed.update(one for one in equation.inputs if isinstance(one, Variable))
            kept.append(equation)
    program.equations[:] = reversed(kept)


def unsupported_type(variable: Variable) -> str:
    """Return what is wrong with a variable's type, or nothing.

    Parameters
    ----------
    variable
        Of a program.
    """
    return "" if variable.dtype is None or supported(variable.dtype) else str(variable.dtype)
