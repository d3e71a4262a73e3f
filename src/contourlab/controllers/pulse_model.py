"""Axes as a controller sees them at its samples: pulse transfer functions, and observers on them.

    A(z) y = B(z) u,    A = z^n + a_1 z^(n-1) + ... + a_n,    B = b_1 z^(n-1) + ... + b_n,

each axis for itself, in observer canonical form (G, H, C): with G's first column -a, ones above its
diagonal, H = b and C = [1 0 ... 0]. So is every printed model of Cao and Zhang.

From a nominal model M q'' + B q' + S q = K u the pulse transfer function is exact for a command
that is held over the sample.

**Observer.** A disturbance d is taken to enter with the command and to be the output of a system
with known poles: a constant (pole 1, an *extended state observer*) and sinusoids of known
frequencies. On a slave it is unit 3 of :mod:`~contourlab.controllers.augmentation`, the internal
model of the disturbance. All poles of the observer are put at one place λ = exp(-2π f T). States of
the disturbance are in units of the position (b_1 d), which keeps the numbers of one size.

References
----------
.. [CaoZhang] (19), (43), (44), and section 7, which announces the extended state observer.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, part, real
from contourlab.controllers.augmentation import disturbance_blocks
from contourlab.controllers.held_model import held_polynomials
from contourlab.machines.base import NominalModel
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["AxisObserver", "ObserverState", "PulseModel"]


class PulseModel(Configuration):
    """Pulse transfer functions of several axes, all of one order n.

    Parameters
    ----------
    denominator
        a, shape (n_axes, n).
    numerator
        b, shape (n_axes, n) [m per unit of command].
    """

    denominator: Float[Array, "n_axes order"] = real()
    numerator: Float[Array, "n_axes order"] = real()

    @staticmethod
    def of_model(model: NominalModel, sample_time: Scalar) -> PulseModel:
        """Return what a nominal model is at its samples, without Coulomb friction.

        Parameters
        ----------
        model
            M q'' + B q' + S q = K u.
        sample_time
            T [s].
        """
        numerator, denominator = held_polynomials(model, sample_time)
        return PulseModel(denominator=denominator[:, 1:], numerator=numerator)

    @property
    def order(self) -> int:
        """n."""
        return int(np.shape(self.denominator)[-1])

    def of_axes(self, axes: tuple[int, ...]) -> PulseModel:
        """Return the model of some of the axes.

        Parameters
        ----------
        axes
            Which.
        """
        rows = np.asarray(axes, int)
        return PulseModel(denominator=self.denominator[rows], numerator=self.numerator[rows])

    def rest(self, position: AxisVector) -> tuple[Array, AxisVector]:
        """Return the state at rest, shape (n_axes, n), and the command that holds it.

        Parameters
        ----------
        position
            Shape (n_axes,) [m].
        """
        command = position * (1.0 + jnp.sum(self.denominator, -1)) / jnp.sum(self.numerator, -1)
        held = self.numerator * command[:, None] - self.denominator * position[:, None]
        # x_i = x_(i+1) - a_i y + b_i u, from the last one up
        return jnp.cumsum(held[:, ::-1], -1)[:, ::-1], command

    def advance(self, state: Array, command: AxisVector) -> Array:
        """Return the state one sample later, shape (n_axes, n).

        Parameters
        ----------
        state
            Shape (n_axes, n); its first column is the position [m].
        command
            Held over the sample, shape (n_axes,).
        """
        shifted = jnp.concatenate([state[:, 1:], jnp.zeros_like(state[:, :1])], -1)
        return shifted - self.denominator * state[:, :1] + self.numerator * command[:, None]


class ObserverState(NamedTuple):
    """What the observers of several axes hold."""

    axes: Array
    """Of the axes, shape (n_axes, n) [m]: predicted for this instant."""
    disturbance: Array
    """Of the disturbances, shape (n_axes, n_d) [m]; none if n_d is 0."""


class AxisObserver(Configuration):
    """One observer for each axis, with the disturbance's model; made by :meth:`of_model`."""

    model: PulseModel = part()
    gain: Float[Array, "n_axes size"] = real()
    """Of the innovation y - ŷ, shape (n_axes, n + n_d)."""
    rotation: Float[Array, "n_d n_d"] = real()
    """Of the disturbance's states, the same for all axes."""
    output: Float[Array, " n_d"] = real()
    """From them to the disturbance."""

    @staticmethod
    def of_model(
        model: PulseModel, bandwidth_hz: Array, frequencies_hz: AxisVector, sample_time: Scalar
    ) -> AxisObserver:
        """Return observers with all their poles at exp(-2π f T).

        Parameters
        ----------
        model
            Of the axes.
        bandwidth_hz
            f, shape (n_axes,) [Hz].
        frequencies_hz
            Of the disturbance [Hz]; 0 stands for a constant, which is always among what it may be
            where this is not empty.
        sample_time
            T [s].
        """
        gain, rotation, output = _designed(
            model, bandwidth_hz, frequencies_hz, jnp.asarray(sample_time, float)
        )
        return AxisObserver(model=model, gain=gain, rotation=rotation, output=output)

    def init(self, position: AxisVector) -> ObserverState:
        """Return the state of axes at rest and undisturbed.

        Parameters
        ----------
        position
            Measured, shape (n_axes,) [m].
        """
        axes, _ = self.model.rest(position)
        return ObserverState(axes, jnp.zeros((axes.shape[0], self.rotation.shape[0])))

    def disturbance(self, state: ObserverState) -> AxisVector:
        """Return the disturbance, in units of the command, shape (n_axes,).

        Parameters
        ----------
        state
            Of this instant.
        """
        return jnp.sum(self.output * state.disturbance, -1) / self.model.numerator[:, 0]

    def step(
        self, state: ObserverState, position: AxisVector, command: AxisVector
    ) -> ObserverState:
        """Return the state predicted for the next instant.

        Parameters
        ----------
        state
            Predicted for this instant.
        position
            Measured now, shape (n_axes,) [m].
        command
            That acts until then, shape (n_axes,).
        """
        order = self.model.order
        innovation = (position - state.axes[:, 0])[:, None]
        axes = self.model.advance(state.axes, command + self.disturbance(state))
        turned = jnp.sum(self.rotation * state.disturbance[:, None, :], -1)
        return ObserverState(
            axes + self.gain[:, :order] * innovation, turned + self.gain[:, order:] * innovation
        )


@jax.jit
def _designed(
    model: PulseModel, bandwidth_hz: Array, frequencies_hz: Array, sample_time: Array
) -> tuple[Array, Array, Array]:
    rotation, output = disturbance_blocks(np.shape(frequencies_hz)[0], frequencies_hz, sample_time)
    pole = jnp.exp(-2.0 * np.pi * bandwidth_hz * sample_time)
    rows = zip(model.denominator, model.numerator, pole, strict=True)
    gain = jnp.stack([_placed(a, b, rotation, output, z) for a, b, z in rows])
    return gain, rotation, output


def _placed(a: Array, b: Array, rotation: Array, output: Array, pole: Scalar) -> Array:
    """Return the gain that puts every pole of one axis's observer at one place (Ackermann)."""
    order, size = a.shape[0], a.shape[0] + rotation.shape[0]
    whole = jnp.zeros((size, size))
    whole = whole.at[:order, 0].set(-a)
    whole = whole.at[np.arange(order - 1), np.arange(1, order)].set(1.0)
    whole = whole.at[:order, order:].set((b / b[0])[:, None] * output)
    whole = whole.at[order:, order:].set(rotation)
    row = jnp.zeros(size).at[0].set(1.0)
    seen = []
    for _ in range(size):
        seen.append(row)
        row = row @ whole
    moved, power = whole - pole * jnp.eye(size), jnp.eye(size)
    for _ in range(size):
        power = power @ moved
    last = jnp.zeros(size).at[-1].set(1.0)
    gain: Array = power @ jnp.linalg.solve(jnp.stack(seen), last)
    return gain
