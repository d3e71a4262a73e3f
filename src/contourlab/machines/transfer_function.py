"""Axes given by transfer functions from command to position, such as drives with their own loop.

Each axis is a strictly proper rational function of s, realised in controllable canonical form and
discretised by the matrix exponential: exact at the sampling instants for a command that is held
(zero-order hold), whatever the order. Suits identified drives, K / (s (τ s + 1)) and resonances.

Time is scaled inside the realisation (s = ω p with ω of the size of the poles), so that the
coefficients of a high order stay near one. Axes of lower order are padded with states that are
neither driven nor seen.

Limits: no dry friction, which needs to know where in the loop it acts. A disturbance adds to the
command (after the clip) and has its unit.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import check_real, is_concrete
from contourlab.errors import ConfigurationError
from contourlab.machines.base import (
    BoundDynamics,
    Dynamics,
    LinearModel,
    NominalModel,
    PerAxis,
    per_axis,
)
from contourlab.machines.drive import Drive
from contourlab.machines.exponential import LARGEST_NORM, exponential
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["BoundTransferFunctionAxes", "TransferFunctionAxes", "TransferFunctionState"]


class TransferFunctionState(eqx.Module):
    """States of the realisation, and what drove it last."""

    modes: Float[Array, "n_axes order"]
    drive: AxisVector
    """Command plus disturbance just before this instant: the velocity of an axis of relative degree
    one depends on it."""


def _polynomials(value: Any) -> Any:
    """One leaf per axis: converted like other leaves, and left alone if JAX put placeholders in."""
    if not isinstance(value, tuple | list):
        return value
    return tuple(
        np.asarray(p, np.float64) if isinstance(p, list | tuple | np.ndarray) else p for p in value
    )


class TransferFunctionAxes(Dynamics):
    """One transfer function per axis, from command to position.

    Coefficients in descending powers of s, as in SciPy; the axes may differ in order.
    """

    numerators: tuple[PerAxis, ...] = eqx.field(converter=_polynomials, kw_only=True)
    """Per axis, in m per unit of command."""
    denominators: tuple[PerAxis, ...] = eqx.field(converter=_polynomials, kw_only=True)
    """Per axis; a last coefficient of zero is an integrator."""

    def check(self) -> None:
        """Check that every function is strictly proper and moves the axis at low frequency."""
        if len(self.numerators) != len(self.denominators) or not self.numerators:
            raise ConfigurationError(
                "numerators and denominators must be given for the same axes, got "
                f"{len(self.numerators)} and {len(self.denominators)}"
            )
        for axis, (top, bottom) in enumerate(zip(self.numerators, self.denominators, strict=True)):
            check_real(f"numerators[{axis}]", top, ndim=1)
            check_real(f"denominators[{axis}]", bottom, ndim=1)
            if np.ndim(top) < 1 or np.ndim(bottom) < 1 or np.shape(top)[-1] >= np.shape(bottom)[-1]:
                raise ConfigurationError(
                    f"axis {axis}: the transfer function must be strictly proper, the numerator "
                    f"shorter than the denominator, got shapes {np.shape(top)} and "
                    f"{np.shape(bottom)}"
                )
            if np.any(np.asarray(bottom)[..., 0] == 0.0):
                raise ConfigurationError(
                    f"denominators[{axis}] must not start with zero: leave leading zeros out"
                )
            if np.any(np.asarray(top)[..., -1] == 0.0):
                raise ConfigurationError(
                    f"numerators[{axis}] must not end with zero: an axis that a constant command "
                    "does not move cannot be brought to a position"
                )

    def check_axes(self, n_axes: int) -> None:
        """Check that there is one transfer function per axis.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        if len(self.numerators) != n_axes:
            raise ConfigurationError(
                f"numerators must have one polynomial per axis, {n_axes}, "
                f"got {len(self.numerators)}"
            )

    def bind(
        self, n_axes: int, durations: tuple[Scalar, ...], substeps: int
    ) -> BoundTransferFunctionAxes:
        """Return the axes for intervals of known length.

        Parameters
        ----------
        n_axes
            Number of axes.
        durations
            Length of each part of a control period over which the command is constant [s].
        substeps
            Not needed: the solution is exact.
        """
        del substeps
        bound: BoundTransferFunctionAxes
        bound, norm = _discretise(self.numerators, self.denominators, durations)
        if is_concrete(norm) and not norm <= LARGEST_NORM:
            raise ConfigurationError(
                f"a pole is too fast for the sample time: pole times sample time must be <= "
                f"{LARGEST_NORM:g}, got {float(norm):g}; leave such a pole out of the model"
            )
        return bound

    def nominal(self, n_axes: int, drive: Drive) -> NominalModel:
        """Return the model K / (s (T s + 1)) with the same first two terms at low frequency.

        Parameters
        ----------
        n_axes
            Number of axes.
        drive
            Kind and limit of the command.

        Raises
        ------
        ConfigurationError
            An axis is no single integrator with a lag: the machine needs a ``nominal_model``.
        """
        gains, lags = [], []
        for axis, (top, bottom) in enumerate(zip(self.numerators, self.denominators, strict=True)):
            a, b = jnp.asarray(bottom)[..., ::-1], jnp.asarray(top)[..., ::-1]  # ascending
            why = ""
            if np.shape(a)[-1] < 3:
                why = "it is of first order"
            elif is_concrete(a) and np.any(np.asarray(a)[..., 0] != 0.0):
                why = "it has no integrator"
            elif is_concrete(a) and np.any(np.asarray(a)[..., 1] == 0.0):
                why = "it integrates twice"
            else:
                gain = b[..., 0] / a[..., 1]
                second = b[..., 1] / b[..., 0] if np.shape(b)[-1] > 1 else 0.0
                lag = a[..., 2] / a[..., 1] - second
                if is_concrete(gain) and not np.all(np.asarray(gain) > 0.0):
                    why = "its gain at low frequency is not positive"
                elif is_concrete(lag) and not np.all(np.asarray(lag) > 0.0):
                    why = "its phase leads at low frequency"
            if why:
                raise ConfigurationError(
                    f"axis {axis} is not close to K / (s (T s + 1)) at low frequency, because "
                    f"{why}; give the machine a nominal_model"
                )
            gains.append(gain)
            lags.append(lag)
        return NominalModel(
            mass=jnp.stack(lags, -1), viscous=np.ones(n_axes), coulomb=np.zeros(n_axes),
            gain=jnp.stack(gains, -1),
            command_limit=per_axis("command_limit", drive.command_limit, n_axes),
            command=drive.command,
        )  # fmt: skip

    def linear(self, n_axes: int) -> LinearModel:
        """Return the functions in controllable canonical form, one block per axis.

        Parameters
        ----------
        n_axes
            Number of axes.
        """
        from scipy.linalg import block_diag

        blocks: list[tuple[Any, Any, Any]] = []
        for axis in range(n_axes):
            top, bottom = (np.asarray(x[axis]) for x in (self.numerators, self.denominators))
            order = len(bottom) - 1
            a, b, c = np.eye(order, k=1), np.zeros((order, 1)), np.zeros((1, order))
            a[-1], b[-1] = -bottom[:0:-1] / bottom[0], 1.0
            c[0, : len(top)] = top[::-1] / bottom[0]
            blocks.append((a, b, c))
        state, drive, output = (block_diag(*matrices) for matrices in zip(*blocks, strict=True))
        return LinearModel(state, drive, output, output)


class BoundTransferFunctionAxes(BoundDynamics):
    """Transfer functions for one sample time."""

    transition: Float[Array, "n_parts n_axes order order"]
    """exp(A h)."""
    input: Float[Array, "n_parts n_axes order"]
    """∫ exp(A t) B dt over the part."""
    output: Float[Array, "n_axes order"]
    """C."""
    rate: Float[Array, "n_axes order"]
    """C A [1/s]."""
    feed: AxisVector
    """C B: not zero for relative degree one."""
    still: Float[Array, "n_axes 6"]
    """Per axis c₁, c₂, ã₀ and ã₁ (of p⁰ and p¹ in the scaled denominator), ω, size of the input."""
    orders: tuple[int, ...] = eqx.field(static=True)
    """Order of each axis before it was padded."""

    def steady(
        self, position: AxisVector, velocity: AxisVector
    ) -> tuple[TransferFunctionState, AxisVector]:
        """Return the state in steady motion and the command that keeps it.

        Steady motion is x(t) = x₀ + w t under u(t) = u₀ + r t: A w + B r = 0 and C w = v, then
        A x₀ + B u₀ = w and C x₀ = q. In the canonical form only two states differ from zero.

        Parameters
        ----------
        position
            Shape (n_axes,) [m].
        velocity
            Shape (n_axes,) [m/s].
        """
        c_1, c_2, a_0, a_1, omega, size = self.still.T
        second = velocity / (c_1 * omega)
        first = (position - c_2 * second) / c_1
        modes = jnp.zeros_like(self.output).at[:, 0].set(first)
        if self.output.shape[-1] > 1:
            modes = modes.at[:, 1].set(jnp.where(np.asarray(self.orders) > 1, second, 0.0))
        command = (a_0 * first + a_1 * second) / size
        return TransferFunctionState(modes, command), command

    def advance(
        self,
        state: TransferFunctionState,
        commands: tuple[AxisVector, ...],
        disturbance: AxisVector,
    ) -> TransferFunctionState:
        """Return the state one control period later.

        Parameters
        ----------
        state
            State at its start.
        commands
            One per part of the period, shape (n_axes,) each.
        disturbance
            Added to the commands, shape (n_axes,).
        """
        modes, drive = state.modes, state.drive
        for part, command in enumerate(commands):
            drive = command + disturbance
            # a product and a sum: XLA fuses these, while a small matrix product is a call
            modes = jnp.sum(self.transition[part] * modes[:, None, :], -1)
            modes = modes + self.input[part] * drive[:, None]
        return TransferFunctionState(modes, drive)

    def position(self, state: TransferFunctionState) -> AxisVector:
        """Return the true axis positions [m].

        Parameters
        ----------
        state
            State of the axes.
        """
        return jnp.sum(self.output * state.modes, -1)

    def velocity(self, state: TransferFunctionState) -> AxisVector:
        """Return the true axis velocities just before this instant [m/s].

        Parameters
        ----------
        state
            State of the axes.
        """
        return jnp.sum(self.rate * state.modes, -1) + self.feed * state.drive


@jax.jit
def _discretise(
    numerators: Any, denominators: Any, durations: tuple[Scalar, ...]
) -> tuple[BoundTransferFunctionAxes, Array]:
    """Return the bound axes, and the norm of A h for the check."""
    orders = tuple(len(bottom) - 1 for bottom in denominators)
    order = max(orders)
    realised = [
        _realise(jnp.asarray(top), jnp.asarray(bottom), order)
        for top, bottom in zip(numerators, denominators, strict=True)
    ]
    a, b, c, still = (jnp.stack(matrices) for matrices in zip(*realised, strict=True))
    driven = jnp.concatenate([a, b[..., None]], -1)
    block = jnp.concatenate([driven, jnp.zeros_like(driven[:, :1])], -2)
    held = exponential(jnp.stack([block * h for h in durations]))
    bound = BoundTransferFunctionAxes(
        held[..., :order, :order], held[..., :order, order], c,
        jnp.sum(c[..., None] * a, -2), jnp.sum(c * b, -1), still, orders,
    )  # fmt: skip
    longest = jnp.max(jnp.stack([jnp.asarray(h) for h in durations]))
    return bound, longest * jnp.max(jnp.sum(jnp.abs(a), -1))


def _realise(top: Array, bottom: Array, order: int) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C of one axis in scaled canonical form, padded, and what steady motion needs."""
    n = int(bottom.shape[-1]) - 1
    powers = np.arange(1, n + 1)
    a = bottom[1:] / bottom[0]
    b = jnp.concatenate([jnp.zeros(n - top.shape[-1]), top]) / bottom[0]
    # the scales cancel out of the transfer function, so no derivative goes through them
    omega = jnp.max(jnp.abs(jax.lax.stop_gradient(a)) ** (1.0 / powers))
    omega = jnp.where(omega > 0.0, omega, 1.0)
    a, b = a / omega**powers, b / omega**powers
    size = jnp.max(jnp.abs(jax.lax.stop_gradient(b)))
    matrix = jnp.zeros((order, order)).at[np.arange(n - 1), np.arange(1, n)].set(1.0)
    matrix = matrix.at[n - 1, :n].set(-a[::-1])
    matrix = matrix.at[np.arange(n, order), np.arange(n, order)].set(-1.0)
    drive = jnp.zeros(order).at[n - 1].set(size)
    output = jnp.zeros(order).at[:n].set(b[::-1] / size)
    c_2 = output[1] if n > 1 else jnp.zeros(())
    a_1 = a[-2] if n > 1 else jnp.ones(())
    still = jnp.stack([output[0], c_2, a[-1], a_1, omega, size])
    return omega * matrix, omega * drive, output, still
