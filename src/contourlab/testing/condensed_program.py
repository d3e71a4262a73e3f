"""A program over stages as one dense program in its inputs alone, for solvers that judge ours."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.quadratic_program_stages import StagedProgram

__all__ = ["CondensedProgram", "condensed_program"]


class CondensedProgram(NamedTuple):
    """min u' H u / 2 + f' u, lower <= A u <= upper; rows without a bound are left out."""

    hessian: NDArray[Any]
    gradient: NDArray[Any]
    rows: NDArray[Any]
    lower: NDArray[Any]
    upper: NDArray[Any]
    penalty: NDArray[Any]
    """Of soft rows, infinite for hard ones."""


def condensed_program(program: StagedProgram) -> CondensedProgram:
    """Return a program in its inputs alone, stage after stage, in NumPy.

    Parameters
    ----------
    program
        One, not a batch.
    """
    p: Any = jax.tree.map(np.asarray, program)
    d = np.asarray(program.dynamics.back(jnp.eye(program.dynamics.n_states))).T
    n_x, n_y = d.shape
    n_u, n = n_y - n_x, p.n_stages
    n_z = p.state_hessian.shape[-1]
    hessian, slope = np.zeros((n * n_u, n * n_u)), np.zeros(n * n_u)
    found: list[tuple[Any, ...]] = []
    a, c = np.zeros((n_x, n * n_u)), p.start  # x = a u + c
    for j in range(n):
        pick = np.zeros((n_u, n * n_u))
        pick[:, j * n_u : (j + 1) * n_u] = np.eye(n_u)
        y, z = np.vstack([a, pick]), np.concatenate([c, np.zeros(n_u)])
        hessian += y.T @ p.stage_hessian @ y
        slope += y.T @ (p.stage_hessian @ z + p.stage_gradient[j])
        found.append((pick, p.lower[j], p.upper[j], np.full(n_u, np.inf)))
        a, c = d @ y, d @ z
        hessian += a[:n_z].T @ p.state_hessian[j] @ a[:n_z]
        slope += a[:n_z].T @ (p.state_hessian[j] @ c[:n_z] + p.state_gradient[j])
        for rows in p.rows:
            at_end = rows.over == "end"
            if at_end and j < n - 1:
                continue
            normals = rows.normals if at_end else rows.normals[j]
            upper = rows.upper if at_end else rows.upper[j]
            lower = rows.lower if at_end or rows.lower is None else rows.lower[j]
            lower = np.full_like(upper, -np.inf) if lower is None else lower
            penalty = np.full_like(upper, np.inf) if rows.penalty is None else rows.penalty
            width = normals.shape[-1]
            over, rest = (y, z) if rows.over == "stage" else (a[:width], c[:width])
            found.append((normals @ over, lower - normals @ rest, upper - normals @ rest, penalty))
    rows, lower, upper, penalty = (np.concatenate(part) for part in zip(*found, strict=True))
    keep = np.isfinite(lower) | np.isfinite(upper)
    return CondensedProgram(
        0.5 * (hessian + hessian.T), slope, rows[keep], lower[keep], upper[keep], penalty[keep]
    )
