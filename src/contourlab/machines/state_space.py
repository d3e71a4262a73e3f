"""Axes given by an identified state space, each axis for itself or all of them with cross-talk.

    discrete, at the sample time of the identification     x(k+1) = A x(k) + B u(k),  y = C x + D u
    continuous                                             x'     = A x    + B u,     y = C x + D u

u is the command of every axis, held between samples, and y the position of every axis, or its
velocity. A velocity is integrated: exactly in continuous time, by the trapezoidal rule in discrete
time, q(k+1) = q(k) + T (y(k) + y(k+1)) / 2 with u(k) in both. A position must not answer at once
(D = 0); a velocity may.

A discrete model holds for its own control period only, and for commands that act over whole
periods. Elsewhere it is refused. ``continuous()`` turns it into a continuous one by the matrix
logarithm, where there is a real one: not with a pole at zero (a delay: give it to the drive) or on
the negative real axis, and only right if the identified command was held over the period. A
continuous model is discretised by the matrix exponential for whatever interval, exactly.

A disturbance adds to the command (after the clip) and has its unit. The velocity of a discrete
model that gives positions is known as the difference over the period only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import is_concrete, real, static
from contourlab.errors import ConfigurationError
from contourlab.machines.base import (
    Dynamics,
    LinearModel,
    NominalModel,
    per_axis,
)
from contourlab.machines.drive import Drive
from contourlab.machines.exponential import LARGEST_NORM, exponential
from contourlab.machines.state_space_motion import BoundStateSpaceAxes
from contourlab.typing import Array, Scalar

__all__ = ["StateSpaceAxes"]

Table = Float[Array, "... rows columns"] | Sequence[Sequence[float]]
_MARGIN = 1e-6
"""By how much a pole may pass the stability boundary: a double integrator is known to √eps."""


class StateSpaceAxes(Dynamics):
    """One state space from all commands to all axes; see :meth:`per_axis` for one of each."""

    state_matrix: Table = real(ndim=2)
    """A, shape (n, n)."""
    input_matrix: Table = real(ndim=2)
    """B, shape (n, n_axes)."""
    output_matrix: Table = real(ndim=2)
    """C, shape (n_axes, n) [m or m/s]."""
    direct_matrix: Table | None = real(ndim=2, default=None)
    """D, shape (n_axes, n_axes), for velocities only; zero if not given."""
    sample_time: float | None = static(default=None)
    """Of the identification [s]; None for a continuous model."""
    output: Literal["position", "velocity"] = static(
        allowed=("position", "velocity"), default="position"
    )
    """What y is."""

    @classmethod
    def per_axis(cls, axes: Sequence[StateSpaceAxes]) -> StateSpaceAxes:
        """Return axes that know nothing of each other, from one model for each.

        Parameters
        ----------
        axes
            In the order of the machine's axes; of one kind and sample time.

        Raises
        ------
        ConfigurationError
            They differ in sample time or output, or none is given.
        """
        if not axes:
            raise ConfigurationError("axes must be one model or more, got none")
        kinds = {(one.sample_time, one.output) for one in axes}
        if len(kinds) > 1:
            shown = sorted(f"{output} at {time}" for time, output in kinds)
            raise ConfigurationError(
                f"axes must have one sample_time and one output, got {', '.join(shown)}"
            )
        from scipy.linalg import block_diag

        names = ("state_matrix", "input_matrix", "output_matrix")
        blocks = {name: block_diag(*(np.asarray(getattr(a, name)) for a in axes)) for name in names}
        direct = None
        if any(a.direct_matrix is not None for a in axes):
            direct = block_diag(*(a._direct for a in axes))
        return cls(
            **blocks, direct_matrix=direct, sample_time=axes[0].sample_time, output=axes[0].output
        )

    def __check_init__(self) -> None:
        time = self.sample_time
        if time is not None and not (
            isinstance(time, int | float) and not isinstance(time, bool) and 0.0 < time < np.inf
        ):
            raise ConfigurationError(f"sample_time must be > 0 s, got {time!r}")

    def check(self) -> None:
        """Check shapes, stability, causality, and that every position can be held."""
        order, inputs = np.shape(self.state_matrix)[-1], np.shape(self.input_matrix)[-1]
        outputs = np.shape(self.output_matrix)[-2]
        wanted = {
            "state_matrix": (order, order), "input_matrix": (order, inputs),
            "output_matrix": (inputs, order), "direct_matrix": (inputs, inputs),
        }  # fmt: skip
        if inputs != outputs:
            raise ConfigurationError(
                "there must be one command per axis: input_matrix has "
                f"{inputs} columns and output_matrix {outputs} rows"
            )
        for name, shape in wanted.items():
            value = getattr(self, name)
            if value is not None and np.shape(value)[-2:] != shape:
                raise ConfigurationError(f"{name} must have shape {shape}, got {np.shape(value)}")
        if self.output == "position" and np.any(self._direct != 0.0):
            raise ConfigurationError(
                "direct_matrix must be zero for positions: a position does not jump with the "
                "command; if the model is one sample ahead, shift it"
            )
        self._check_stable()
        whole = np.asarray(_augmented(self)[3])
        # relative to its rows and columns, which may have any unit
        scaled = whole / np.maximum(np.max(np.abs(whole), -1, keepdims=True), 1e-300)
        scaled = scaled / np.maximum(np.max(np.abs(scaled), -2, keepdims=True), 1e-300)
        if np.any(np.linalg.cond(scaled) > 1e13):
            raise ConfigurationError(
                "the axes cannot be brought to a position and held there: the model has a zero at "
                "steady state, or an integrator that the command does not reach or the output does "
                "not show; remove it (a minimal realisation)"
            )

    def _check_stable(self) -> None:
        poles = np.linalg.eigvals(np.asarray(self.state_matrix))
        discrete = self.sample_time is not None
        size = np.abs(poles) if discrete else poles.real
        bound = 1.0 if discrete else 0.0
        scale = 1.0 if discrete else np.maximum(1.0, np.max(np.abs(poles), -1, keepdims=True))
        if np.any(size > bound + _MARGIN * scale):
            worst = poles.reshape(-1)[int(np.argmax(size))]
            where = "inside the unit circle" if discrete else "left of the imaginary axis"
            raise ConfigurationError(
                f"state_matrix is unstable: its poles must be {where} or on it, got "
                f"{worst:.6g}; an identified axis drifts at most like an integrator"
            )

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return int(np.shape(self.input_matrix)[-1])

    @property
    def _direct(self) -> Any:
        if self.direct_matrix is not None:
            return self.direct_matrix
        return np.zeros((self.n_axes, self.n_axes))

    def check_axes(self, n_axes: int) -> None:
        """Check that the model is for this many axes.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        if self.n_axes != n_axes:
            raise ConfigurationError(
                f"input_matrix must have one column per axis, {n_axes}, got {self.n_axes}"
            )

    def continuous(self) -> StateSpaceAxes:
        """Return the continuous model that answers alike to a command held over the period.

        Raises
        ------
        ConfigurationError
            There is none, because of a pole at zero or on the negative real axis.
        """
        if self.sample_time is None:
            return self
        from scipy.linalg import logm

        a, b = np.asarray(self.state_matrix), np.asarray(self.input_matrix)
        n = a.shape[-1]
        if a.ndim != 2:
            raise ConfigurationError("a batch of models has no continuous form here: convert each")
        poles = np.linalg.eigvals(a)
        for pole in poles:
            if abs(pole) < 1e-9:
                raise ConfigurationError(
                    "a pole at zero is a delay of one sample, which no continuous model of finite "
                    "order has; remove it and give the drive a computing_delay"
                )
            if pole.real < 0.0 and abs(pole.imag) < 1e-9 * abs(pole):
                raise ConfigurationError(
                    f"a pole on the negative real axis, {pole.real:.4g}, changes sign from sample "
                    "to sample: no continuous model of the same order does"
                )
        block = np.block([[a, b], [np.zeros((self.n_axes, n)), np.eye(self.n_axes)]])
        root = np.real(logm(block)) / self.sample_time
        return StateSpaceAxes(
            state_matrix=root[:n, :n], input_matrix=root[:n, n:],
            output_matrix=self.output_matrix, direct_matrix=self.direct_matrix,
            output=self.output,
        )  # fmt: skip

    def bind(
        self, n_axes: int, durations: tuple[Scalar, ...], substeps: int
    ) -> BoundStateSpaceAxes:
        """Return the axes for intervals of known length.

        Parameters
        ----------
        n_axes
            Number of axes.
        durations
            Length of each part of a control period over which the command is constant [s].
        substeps
            Not needed: the solution is exact.

        Raises
        ------
        ConfigurationError
            A discrete model at another control period than its own, or at a delay that is no
            multiple of it; a continuous one with a pole too fast for the period.
        """
        del n_axes, substeps
        a, b, c, whole = _augmented(self)
        time = self.sample_time
        if time is not None:
            length = durations[0]
            if not is_concrete(length):
                raise ConfigurationError(
                    "a discrete model needs a sample time that is a number: bind the machine "
                    "outside jit, vmap and grad over the sample time"
                )
            if len(durations) > 1 or abs(float(length) - time) > 1e-9 * time:
                why = (
                    "the computing delay cuts the control period"
                    if len(durations) > 1
                    else f"the control period is {float(length):g} s"
                )
                raise ConfigurationError(
                    f"the model was identified at {time:g} s and {why}; use its continuous() form "
                    "(resample = true in a machine file)"
                )
            transition, drive = a[None], b[None]
            step: Any = time
        else:
            order, inputs = a.shape[-1], b.shape[-1]
            block = jnp.concatenate([a, b], -1)
            block = jnp.concatenate([block, jnp.zeros((inputs, order + inputs))], -2)
            lengths = jnp.stack([jnp.asarray(d, float) for d in durations])
            norm = jnp.max(lengths) * jnp.max(jnp.sum(jnp.abs(block), -1))
            if is_concrete(norm) and not norm <= LARGEST_NORM:
                raise ConfigurationError(
                    "the state space is too fast or too badly scaled for the sample time: the norm "
                    f"of A times sample time must be <= {LARGEST_NORM:g}, got {float(norm):g}; "
                    "leave out the fast pole or balance the states"
                )
            held = jax.jit(exponential)(lengths[:, None, None] * block)
            transition, drive = held[:, :order, :order], held[:, :order, order:]
            step = None
        rate: Array | None = None
        feed: Array | None = None
        if self.output == "velocity":  # states end with the positions
            rate = jnp.concatenate(
                [jnp.asarray(self.output_matrix), jnp.zeros((self.n_axes, self.n_axes))], -1
            )
            feed = jnp.asarray(self._direct)
        elif step is None:
            rate, feed = c @ a, c @ b
        whole = jnp.asarray(whole)
        return BoundStateSpaceAxes(
            jnp.asarray(transition), jnp.asarray(drive), jnp.asarray(c), rate, feed, whole,
            jnp.linalg.inv(whole), None if step is None else jnp.asarray(step, float),
        )  # fmt: skip

    def nominal(self, n_axes: int, drive: Drive) -> NominalModel:
        """Return M q'' + B q' = u with the same first two terms at low frequency; no cross-talk.

        Parameters
        ----------
        n_axes
            Number of axes.
        drive
            Kind and limit of the command.

        Raises
        ------
        ConfigurationError
            An axis is no integrator with a lag: the machine needs a ``nominal_model``.
        """
        mass, viscous, spring = self._low_frequency()
        for axis in range(n_axes) if is_concrete(mass) else ():
            m, v, k = (float(np.max(np.asarray(x)[..., axis])) for x in (mass, viscous, spring))
            # what counts beside the others at 1 rad/s, far below any servo bandwidth
            why = ""
            if abs(k) > 1e-6 * (abs(v) + abs(m)):
                why = "it has no integrator"
            elif not m > 0.0:
                why = "its phase leads at low frequency"
            elif v < -1e-9 * m:
                why = "its gain at low frequency is not positive"
            if why:
                raise ConfigurationError(
                    f"axis {axis} is not close to K / (s (T s + 1)) at low frequency, because "
                    f"{why}; give the machine a nominal_model"
                )
        return NominalModel(
            mass=mass, viscous=jnp.maximum(viscous, 0.0), coulomb=np.zeros(n_axes),
            gain=np.ones(n_axes),
            command_limit=per_axis("command_limit", drive.command_limit, n_axes),
            command=drive.command,
        )  # fmt: skip

    def _low_frequency(self) -> tuple[Array, Array, Array]:
        """Command per acceleration, per velocity and per position, shape (n_axes,) each.

        From x = x₀ + x₁ t + x₂ t² / 2 and u alike under q = t² / 2, one power of t at a time.
        """
        a, _, _, whole = (jnp.asarray(x) for x in _augmented(self))
        order, identity = a.shape[-1], jnp.eye(self.n_axes)
        time = self.sample_time

        def solve(state: Array, position: Array) -> tuple[Array, Array]:
            found = jnp.linalg.solve(whole, jnp.concatenate([state, position], -2))
            return found[:order], found[order:]

        none = jnp.zeros((self.n_axes, self.n_axes))
        second, spring = solve(jnp.zeros((order, self.n_axes)), identity)
        if time is None:
            first, viscous = solve(second, none)
            _, mass = solve(first, none)
        else:
            first, viscous = solve(time * second, none)
            _, mass = solve(time * first + 0.5 * time**2 * second, none)
            mass = mass - 0.5 * time * viscous  # a held command is half a period late
        return jnp.diagonal(mass), jnp.diagonal(viscous), jnp.diagonal(spring)

    def linear(self, n_axes: int) -> LinearModel:
        """Return the model from commands to positions; that of velocities integrated.

        Parameters
        ----------
        n_axes
            Number of axes.
        """
        del n_axes
        a, b, c, _ = (np.asarray(x) for x in _augmented(self))
        return LinearModel(a, b, c, c, self.sample_time)


def _augmented(axes: StateSpaceAxes) -> tuple[Array, Array, Array, Array]:
    """A, B and C to positions, and [[A or A - I, B], [C, 0]], which steady motion solves.

    A model of velocities has the positions as its last states.
    """
    a, b, c, d = axes.state_matrix, axes.input_matrix, axes.output_matrix, axes._direct
    tables = (a, b, c, d)
    xp: Any = jnp if any(isinstance(table, jax.Array) for table in tables) else np
    batch = np.broadcast_shapes(*(np.shape(table)[:-2] for table in tables))
    a, b, c, d = (xp.broadcast_to(table, (*batch, *np.shape(table)[-2:])) for table in tables)
    n_axes, time = axes.n_axes, axes.sample_time
    if axes.output == "velocity":
        order = a.shape[-1]
        still = xp.zeros((*batch, order, n_axes))
        ones = xp.broadcast_to(xp.eye(n_axes), (*batch, n_axes, n_axes))
        if time is None:
            gather, kept, through = c, xp.zeros_like(ones), d
        else:  # q(k+1) = q(k) + T/2 (C x(k) + C x(k+1)) + T D u(k)
            gather = 0.5 * time * (c + c @ a)
            kept, through = ones, 0.5 * time * c @ b + time * d
        a = xp.concatenate([xp.concatenate([a, still], -1), xp.concatenate([gather, kept], -1)], -2)
        b = xp.concatenate([b, through], -2)
        c = xp.concatenate([xp.zeros((*batch, n_axes, order)), ones], -1)
    moved = a if time is None else a - xp.eye(a.shape[-1])
    corner = xp.zeros((*batch, n_axes, n_axes))
    whole = xp.concatenate([xp.concatenate([moved, b], -1), xp.concatenate([c, corner], -1)], -2)
    return a, b, c, whole
