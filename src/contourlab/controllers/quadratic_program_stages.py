"""A quadratic program over stages: its data, and its rows as inequalities with one side.

With y_j = (x_j, u_j), over N stages,

    min  sum_(j=0..N-1) (y_j' R y_j / 2 + r_j' y_j  +  z_(j+1)' C_j z_(j+1) / 2 + c_j' z_(j+1))
    x_0 given,  x_(j+1) = D y_j,  lower_j <= u_j <= upper_j,  and rows,                       (1)

where z are the first entries of x, as many as C_j has. Rows are of z_(j+1) ("state"), of y_j
("stage") or of z_N alone ("end"). A row is *hard*, or *soft*: it may be exceeded by e >= 0 at the
cost of ``penalty`` e. Up to the penalty, which bounds its multiplier, a soft row acts as a hard
one; beyond, it gives way.

For the solver every bound is one inequality a y <= h of one long vector, hard ones first: those of
the inputs, upper and lower, then the rows' in the order in which they are given. Only what there is
costs work: rows with one side have one, and D is known by what it does and not as a matrix.
"""

from __future__ import annotations

import abc
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.typing import Array

__all__ = ["DenseDynamics", "Dynamics", "Rows", "StagedProgram", "widened"]


class Dynamics(eqx.Module):
    """D of (1), as what it does."""

    @property
    @abc.abstractmethod
    def n_states(self) -> int:
        """Length of x."""

    @abc.abstractmethod
    def ahead(self, y: Array) -> Array:
        """Return D y, shape (n_x,).

        Parameters
        ----------
        y
            State and input, shape (n_y,).
        """

    @abc.abstractmethod
    def back(self, x: Array) -> Array:
        """Return D' x, shape (n_y, ...).

        Parameters
        ----------
        x
            Shape (n_x, ...): one column or several.
        """


class DenseDynamics(Dynamics):
    """D as a matrix."""

    matrix: Float[Array, "n_x n_y"]

    @property
    def n_states(self) -> int:
        """Length of x."""
        return int(self.matrix.shape[0])

    def ahead(self, y: Array) -> Array:
        """Return D y, shape (n_x,).

        Parameters
        ----------
        y
            State and input, shape (n_y,).
        """
        return self.matrix @ y

    def back(self, x: Array) -> Array:
        """Return D' x, shape (n_y, ...).

        Parameters
        ----------
        x
            Shape (n_x, ...): one column or several.
        """
        return self.matrix.T @ x


class Rows(eqx.Module):
    """Rows of one kind, with their bounds."""

    over: str = eqx.field(static=True)
    """``state``: of z_(j+1); ``stage``: of y_j; ``end``: of z_N."""
    normals: Array
    """(N, k, width), or (k, width) at the end; narrower than x means its first entries."""
    upper: Array
    """(N, k) or (k,); may be infinite."""
    lower: Array | None = None
    penalty: Array | None = None
    """(k,), > 0, of soft rows; None makes them hard."""


class StagedProgram(eqx.Module):
    """The data of (1)."""

    state_hessian: Float[Array, "n_stages n_z n_z"]
    """C_j, symmetric, positive semidefinite."""
    state_gradient: Float[Array, "n_stages n_z"]
    """c_j."""
    stage_hessian: Float[Array, "n_y n_y"]
    """R, symmetric, positive semidefinite, and definite in the inputs."""
    stage_gradient: Float[Array, "n_stages n_y"]
    """r_j."""
    dynamics: Dynamics
    start: Float[Array, " n_x"]
    """x_0."""
    lower: Float[Array, "n_stages n_u"]
    upper: Float[Array, "n_stages n_u"]
    rows: tuple[Rows, ...] = ()

    @property
    def n_stages(self) -> int:
        """N."""
        return int(self.lower.shape[0])

    @property
    def _order(self) -> list[int]:
        """Indices of ``rows``, hard ones first."""
        soft = [rows.penalty is not None for rows in self.rows]
        return sorted(range(len(soft)), key=lambda k: soft[k])

    @property
    def n_soft(self) -> int:
        """How many inequalities are soft."""
        soft = [rows for rows in self.rows if rows.penalty is not None]
        return sum(math.prod(r.upper.shape) * (1 if r.lower is None else 2) for r in soft)

    def values(self, states: Array, inputs: Array) -> Array:
        """Return a y of every inequality, shape (n_inequalities,).

        Parameters
        ----------
        states, inputs
            Shapes (N + 1, n_x) and (N, n_u).
        """
        y = jnp.concatenate([states[:-1], inputs], axis=1)

        def of(rows: Rows) -> Array:
            width = rows.normals.shape[-1]
            if rows.over == "end":
                return jnp.sum(rows.normals * states[-1, :width], axis=1)
            at = y if rows.over == "stage" else states[1:, :width]
            return jnp.sum(rows.normals * at[:, None, :], axis=2)

        found = [inputs, -inputs]
        for k in self._order:
            value = of(self.rows[k])
            found += [value] if self.rows[k].lower is None else [value, -value]
        return _flat(found)

    def bounds(self) -> tuple[Array, Array]:
        """Return h of every inequality, and ρ of the soft ones (the last); h may be infinite."""
        sides = [self.upper, -self.lower]
        penalties: list[Array] = [jnp.zeros(0)]
        for k in self._order:
            rows = self.rows[k]
            both = [rows.upper] if rows.lower is None else [rows.upper, -rows.lower]
            sides += both
            if rows.penalty is not None:
                penalties += [jnp.broadcast_to(rows.penalty, rows.upper.shape)] * len(both)
        return _flat(sides), _flat(penalties)

    def parts(self, flat: Array) -> tuple[Array, Array, list[Array]]:
        """Return a vector over inequalities as that of inputs (upper, lower) and of ``rows``.

        Parameters
        ----------
        flat
            Shape (n_inequalities,).

        Returns
        -------
        upper, lower
            Of the inputs, shape (N, n_u) each.
        rows
            For each of ``rows``, shape (sides,) and that of its bound.
        """
        at = 0

        def take(shape: tuple[int, ...]) -> Array:
            nonlocal at
            part = flat[at : at + math.prod(shape)]
            at += math.prod(shape)
            return part.reshape(shape)

        upper, lower = take(self.upper.shape), take(self.upper.shape)
        found = {}
        for k in self._order:
            rows = self.rows[k]
            found[k] = take((1 if rows.lower is None else 2, *rows.upper.shape))
        return upper, lower, [found[k] for k in range(len(self.rows))]

    def soft_parts(self, flat: Array) -> list[Array]:
        """Return a vector over the soft inequalities as that of the soft ``rows``, in order.

        Parameters
        ----------
        flat
            Shape (n_soft,).
        """
        soft = [rows.penalty is not None for rows in self.rows]
        of_all = jnp.concatenate([jnp.zeros(len(self.bounds()[0]) - len(flat)), flat])
        return [part for part, is_soft in zip(self.parts(of_all)[2], soft, strict=True) if is_soft]

    def shifted(self, flat: Array) -> Array:
        """Return a vector over inequalities as it stands one stage later, the last stage's twice.

        Parameters
        ----------
        flat
            Shape (n_inequalities,).
        """
        upper, lower, parts = self.parts(flat)
        moved = [
            part if rows.over == "end" else _later(part, 1)
            for rows, part in zip(self.rows, parts, strict=True)
        ]
        return _flat([_later(upper, 0), _later(lower, 0), *(moved[k] for k in self._order)])

    def pull(self, flat: Array) -> tuple[Array, Array]:
        """Return the sum of multipliers times normals, on z_(j+1) and on y_j.

        Parameters
        ----------
        flat
            Multipliers, shape (n_inequalities,).
        """
        upper, lower, parts = self.parts(flat)
        n_x = self.dynamics.n_states
        on_state = jnp.zeros((self.n_stages, self._reach))
        on_stage = jnp.concatenate([jnp.zeros((self.n_stages, n_x)), upper - lower], axis=1)
        for rows, part in zip(self.rows, parts, strict=True):
            push = part[0] if rows.lower is None else part[0] - part[1]
            force = jnp.sum(rows.normals * push[..., None], axis=-2)
            if rows.over == "stage":
                on_stage = on_stage + force
            else:
                on_state = on_state + self._placed(rows, force)
        return on_state, on_stage

    def weighted(self, flat: Array) -> tuple[Array, Array, Array | None]:
        """Return the Hessians that weights on the inequalities make.

        Parameters
        ----------
        flat
            Weights, shape (n_inequalities,).

        Returns
        -------
        state
            Over z_(j+1), shape (N, n, n).
        diagonal
            Over u_j, shape (N, n_u).
        stage
            Over y_j, (N, n_y, n_y); None if there are no such rows.
        """
        upper, lower, parts = self.parts(flat)
        on_state = jnp.zeros((self.n_stages, self._reach, self._reach))
        on_stage = None
        for rows, part in zip(self.rows, parts, strict=True):
            weight = part[0] if rows.lower is None else part[0] + part[1]
            scaled = rows.normals * weight[..., None]
            hessian = jnp.sum(scaled[..., :, None] * rows.normals[..., None, :], axis=-3)
            if rows.over == "stage":
                on_stage = hessian if on_stage is None else on_stage + hessian
            else:
                on_state = on_state + self._placed(rows, hessian)
        return on_state, upper + lower, on_stage

    @property
    def _reach(self) -> int:
        """The most first entries of x that costs or rows after the stages use."""
        widths = [r.normals.shape[-1] for r in self.rows if r.over != "stage"]
        return max([self.state_hessian.shape[-1], *widths])

    def _placed(self, rows: Rows, values: Array) -> Array:
        """Return what rows after the stages make, as wide as ``_reach``, at every stage."""
        wide = widened(values, self._reach, values.ndim - (rows.over != "end"))
        if rows.over == "state":
            return wide
        before = jnp.zeros((self.n_stages - 1, *wide.shape))
        return jnp.concatenate([before, wide[None]])


def _later(part: Array, axis: int) -> Array:
    first = jax.lax.slice_in_dim(part, 1, None, axis=axis)
    return jnp.concatenate([first, jax.lax.slice_in_dim(part, -1, None, axis=axis)], axis=axis)


def _flat(parts: list[Array]) -> Array:
    return jnp.concatenate([part.reshape(-1) for part in parts])


def widened(values: Array, width: int, n_last: int) -> Array:
    """Return an array with zeros after its last dimensions.

    Parameters
    ----------
    values
        Any.
    width
        What the last dimensions are to be.
    n_last
        How many.
    """
    none = [(0, 0, 0)] * (values.ndim - n_last)
    more: list[Any] = [(0, width - size, 0) for size in values.shape[values.ndim - n_last :]]
    return jax.lax.pad(values, jnp.zeros((), values.dtype), none + more)
