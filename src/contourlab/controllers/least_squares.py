"""Filtered least squares: mass, friction and disturbance of every axis, found while it moves.

Each axis by itself obeys M q'' + B q' + A S_f(q') - d = u, in units of the command (the gain of the
drive absorbed), with S_f a smooth sign. A filter H = ω² / (s² + 2 ζ ω s + ω²) over the whole
equation spares the differentiation of noise:

    y · θ = u_f,    y = (s² H q, s H q, H S_f, -H 1),    u_f = H u,    θ = (M, B, A, d)   (1)

The parameters follow by least squares with forgetting, normalised:

    ζ = y · θ̄ - u_f,    N = 1 + ν Σ y · Γ y    (the sum is over the axes)                 (2)
    θ̄' = -Γ y ζ / N,    Γ' = κ Γ - Γ y yᵀ Γ / N,    θ̂ = Proj(θ̄)                          (3)

θ̂, what is used, is kept within its bounds, element by element; θ̄, what is remembered, is not. To
clip θ̄ itself would lose what the other elements are to make of it: Γ has fallen by then as if the
step had been taken, and the loss is made good only at the rate of the forgetting. y and u_f are
held over a sample T, for which (3) has a closed form (without κ)

    Γ⁺ = Γ - T Γ y yᵀ Γ / (N + T y · Γ y),    θ̄⁺ = θ̄ - T Γ y ζ / (N + T y · Γ y)         (4)

after which Γ⁺ grows by e^(κ T). Γ stays positive definite at any sample time; with κ = ν = 0 the
estimate is that of batch least squares with the prior Γ(0), to rounding.

**The limit of Γ.** Forgetting without excitation lets Γ grow for ever: at rest by e^(κ t), until it
overflows. An axis whose block of Γ has a norm above ``covariance_limit``, by default that of its
Γ(0), does not forget (``at_limit="hold"``): its Γ can then only fall.
The norm is that of Frobenius, which is λ_max at least and twice it at most, and needs no
eigenvalues.

**Timing.** A command is held over a sample, so what an encoder shows at t_k comes from the command
of [t_k-1, t_k). Both are brought together by building (1) from the mean velocity
(q_k - q_k-1) / T of the interval and from what acted over it: the filter is Tustin's for q, and for
what is a mean already one of its factors (1 + z⁻¹)/2 is left out. Without that, M is wrong by
B T / 2.

Start it at rest: then zero is the right state of the filters. A record that begins in motion needs
``settle_time`` of some periods of the filter, during which nothing is learned.

Encoder counts bias M (errors in variables): by a factor S / (S + σ²), with S the mean square of
s² H q and σ² that of what the filter leaves of the rounding; a lower cut-off helps, until the
motion itself is filtered away.

References
----------
.. [HuYaoWang] (22) to (25).

Differences from the paper
--------------------------
(22) has + 1_f in its last two columns, with which θ_7 and θ_8 converge to minus the disturbance: d
is on the right-hand side of (5), so the column is -1. (24) and (25) lack ν, which IV.B lists. (25)
sets Γ' = 0 above ρ_M; with the printed ρ_M = 500 and Γ(0) = 5000 it never begins
(``at_limit="freeze"`` does that). The limit is for each axis; the norm is not λ_max. (4) in place
of an Euler step. The projection of what is used, not of what is remembered.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, is_concrete, real, static
from contourlab.controllers.smooth_sign import SHAPES, smooth_sign
from contourlab.errors import ConfigurationError
from contourlab.machines.base import PerAxis
from contourlab.machines.base import per_axis as spread_over_axes
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = [
    "PARAMETERS",
    "BoundLeastSquares",
    "FilterState",
    "FilteredLeastSquares",
    "LeastSquaresState",
]

PARAMETERS = ("mass", "viscous", "coulomb", "disturbance")
"""Rows of θ."""
Parameters = Float[Array, "4 n_axes"]


class FilterState(NamedTuple):
    """What the filters remember."""

    position: AxisVector
    """Last position [m]."""
    memory: Float[Array, "2 4 n_axes"]
    """Last two values inside the filters of velocity, smooth sign, one and command."""
    begun: Scalar
    """1 once an interval has passed."""


class LeastSquaresState(NamedTuple):
    """What the estimator remembers."""

    filters: FilterState
    estimate: Parameters
    """θ̂, within the bounds."""
    free: Parameters
    """θ̄, what least squares make of it without bounds."""
    covariance: Float[Array, "4 4 n_axes"]
    """Γ, one block for each axis."""
    regressor: Parameters
    """The last y."""
    residual: AxisVector
    """The last ζ [command]."""
    age: Count
    """Samples since the start, up to those of ``settle_time``; int32."""


class FilteredLeastSquares(Configuration):
    """Configuration of the estimator; see the module."""

    cutoff_hz: PerAxis = real(unit="Hz", above=0.0, ndim=1, default=150.0)
    """ω / 2π of the filter, one number or one per axis."""
    filter_damping: Scalar = real(above=0.0, ndim=0, default=0.7)
    """ζ of the filter."""
    forgetting: Scalar = real(unit="1/s", minimum=0.0, ndim=0, default=0.1)
    """κ."""
    normalisation: Scalar = real(unit="s", minimum=0.0, ndim=0, default=0.1)
    """ν; 0 for none."""
    initial_covariance: Float[Array, " ..."] | None = real(above=0.0, default=None)
    """Diagonal of Γ(0), one number for each parameter, shape (4,), or (4, n_axes) [θ² per command²
    and s]. If not given, ``INITIAL_SHARE`` of what the bounds leave open: (upper - lower)² over the
    square of half the range of d."""
    covariance_limit: Scalar | None = real(above=0.0, ndim=0, finite=False, default=None)
    """ρ_M: no forgetting above; infinite for none, and then Γ overflows after a long rest. If not
    given: the norm of Γ(0), per axis."""
    at_limit: str = static(allowed=("hold", "freeze"), default="hold")
    """``"hold"``: no forgetting above the limit; ``"freeze"``: Γ stands still, as (25) prints,
    and ``covariance_limit`` must be given."""
    friction_velocity: PerAxis = real(unit="m/s", above=0.0, ndim=1, default=1.0 / 9000.0)
    """v_0 of the smooth sign."""
    friction_shape: str = static(allowed=SHAPES, default="arctan")
    """``"arctan"`` or ``"tanh"``."""
    settle_time: Scalar = real(unit="s", minimum=0.0, ndim=0, default=0.0)
    """Time from the start during which nothing is learned."""

    def bind(self, lower: Any, upper: Any, sample_time: Scalar) -> BoundLeastSquares:
        """Return the estimator for one sample time.

        Parameters
        ----------
        lower, upper
            Bounds of θ, shape (4, n_axes), rows as :data:`PARAMETERS`; infinite for none, and then
            ``initial_covariance`` must be given.
        sample_time
            T [s].

        Raises
        ------
        ConfigurationError
            A cut-off above a quarter of the sampling frequency, bounds or a covariance of the
            wrong shape, no covariance and bounds that are infinite or leave d no range, no limit of
            the covariance to freeze it at.
        """
        n = int(np.shape(lower)[-1]) if np.ndim(lower) else 0
        for name, value in (("lower", lower), ("upper", upper)):
            if np.shape(value) != (4, n):
                raise ConfigurationError(
                    f"{name} must have shape (4, {n}): {', '.join(PARAMETERS)} for each axis; "
                    f"got {np.shape(value)}"
                )
        cutoff = spread_over_axes("cutoff_hz", self.cutoff_hz, n)
        if is_concrete(cutoff) and is_concrete(sample_time):
            highest = 0.25 / float(np.asarray(sample_time))
            if np.any(np.asarray(cutoff) > highest):
                raise ConfigurationError(
                    f"cutoff_hz must be <= {highest:g} Hz, a quarter of the sampling frequency, "
                    f"got {np.max(np.asarray(cutoff)):g} Hz"
                )
        lower, upper = jnp.asarray(lower, float), jnp.asarray(upper, float)
        initial = self._initial(lower, upper, n)
        omega, c = 2.0 * np.pi * cutoff, 2.0 / sample_time
        damped = 2.0 * self.filter_damping * omega * c
        whole = c**2 + damped + omega**2
        return BoundLeastSquares(
            lower=lower, upper=upper, sample_time=sample_time,
            gain=2.0 * omega**2 / whole,
            back=jnp.stack([2.0 * (omega**2 - c**2), c**2 - damped + omega**2]) / whole,
            forgetting=self.forgetting, normalisation=self.normalisation,
            initial=initial, limit=self._limit(initial),
            at_limit=self.at_limit,
            friction_velocity=spread_over_axes("friction_velocity", self.friction_velocity, n),
            friction_shape=self.friction_shape,
            settle=jnp.round(self.settle_time / sample_time),
        )  # fmt: skip

    def _initial(self, lower: Array, upper: Array, n: int) -> Array:
        if self.initial_covariance is None:
            if is_concrete(lower) and not np.all(np.isfinite(lower) & np.isfinite(upper)):
                raise ConfigurationError(
                    "initial_covariance must be given where a parameter has no bounds"
                )
            span = upper - lower
            if is_concrete(span) and not np.all(np.asarray(span[3]) > 0.0):
                raise ConfigurationError(
                    "initial_covariance must be given where the bounds leave d no range: it is "
                    "measured by that"
                )
            scale = 0.25 * span[3] ** 2
            safe = jnp.where(scale > 0.0, scale, 1.0)
            return jnp.where(scale > 0.0, INITIAL_SHARE * span**2 / safe, 0.0)
        given = jnp.asarray(self.initial_covariance)
        if np.shape(given) not in ((4,), (4, n)):
            raise ConfigurationError(
                f"initial_covariance must have shape (4,) or (4, {n}), got {np.shape(given)}"
            )
        return jnp.broadcast_to(given if given.ndim == 2 else given[:, None], (4, n))

    def _limit(self, initial: Array) -> Array:
        if self.covariance_limit is not None:
            return jnp.broadcast_to(jnp.asarray(self.covariance_limit), initial.shape[1:])
        if self.at_limit == "freeze":
            raise ConfigurationError(
                'covariance_limit must be given with at_limit="freeze": the covariance would stand '
                "still from the start"
            )
        return jnp.sqrt(jnp.sum(initial**2, axis=0))  # Frobenius, of a diagonal


INITIAL_SHARE = 250.0
"""What Γ(0) is by default, relative to the bounds [1/s]: of the order of the paper's."""


class BoundLeastSquares(Configuration):
    """The estimator for one sample time; made by :meth:`FilteredLeastSquares.bind`."""

    lower: Parameters = real(finite=False)
    upper: Parameters = real(finite=False)
    sample_time: Scalar = real(unit="s", above=0.0)
    gain: AxisVector = real()
    """2 ω² / a_0 of Tustin's filter."""
    back: Float[Array, "2 n_axes"] = real()
    """a_1 / a_0 and a_2 / a_0."""
    forgetting: Scalar = real(unit="1/s")
    normalisation: Scalar = real(unit="s")
    initial: Parameters = real()
    limit: AxisVector = real(finite=False)
    """ρ_M."""
    friction_velocity: AxisVector = real(unit="m/s")
    settle: Scalar = real()
    """Samples during which nothing is learned."""
    at_limit: str = static()
    friction_shape: str = static()

    def check(self) -> None:
        """Check that no lower bound is above its upper one."""
        wrong = np.argwhere(~(np.asarray(self.lower) <= np.asarray(self.upper)))
        if wrong.size:
            row, axis = wrong[0][-2:]
            raise ConfigurationError(
                f"lower must be <= upper, got {np.asarray(self.lower)[row, axis]:g} and "
                f"{np.asarray(self.upper)[row, axis]:g} for {PARAMETERS[row]} of axis {axis}"
            )

    def init(self, position: AxisVector, estimate: Any) -> LeastSquaresState:
        """Return the state before the first step.

        Parameters
        ----------
        position
            Measured at the start, at rest, shape (n_axes,) [m].
        estimate
            θ̂(0), shape (4, n_axes).
        """
        position = jnp.asarray(position, float)
        n = position.shape[-1]
        estimate = self.project(jnp.asarray(estimate, float))
        covariance = jnp.eye(4)[:, :, None] * jnp.asarray(self.initial)
        return LeastSquaresState(
            FilterState(position, jnp.zeros((2, 4, n)), jnp.zeros(())),
            estimate, estimate, covariance, jnp.zeros((4, n)), jnp.zeros(n),
            jnp.zeros((), jnp.int32),
        )  # fmt: skip

    def project(self, estimate: Parameters) -> Parameters:
        """Return parameters within their bounds.

        Parameters
        ----------
        estimate
            Shape (4, n_axes).
        """
        return jnp.clip(estimate, self.lower, self.upper)

    def filtered(
        self, state: FilterState, position: AxisVector, command: AxisVector
    ) -> tuple[Parameters, AxisVector, FilterState]:
        """Return y and u_f of (1), and the new state of the filters.

        Parameters
        ----------
        state
            As of ``init``, or as it was returned.
        position
            Measured now, shape (n_axes,) [m].
        command
            What acted since the last position, shape (n_axes,).
        """
        velocity = (position - state.position) / self.sample_time
        sign = smooth_sign(velocity, self.friction_velocity, self.friction_shape)
        # before the first interval there is nothing, not even a disturbance
        one = jnp.full_like(velocity, 1.0) * state.begun
        inputs = jnp.stack([velocity, sign, one, command])
        last, older = state.memory[0], state.memory[1]
        inner = inputs - self.back[0] * last - self.back[1] * older
        smooth = self.gain * (inner + last)
        acceleration = self.gain * (2.0 / self.sample_time) * (inner[0] - last[0])
        regressor = jnp.stack([acceleration, smooth[0], smooth[1], -smooth[2]])  # (1)
        after = FilterState(position, jnp.stack([inner, last]), jnp.ones_like(state.begun))
        return regressor, smooth[3], after

    def step(
        self, state: LeastSquaresState, position: AxisVector, command: AxisVector
    ) -> LeastSquaresState:
        """Return the state after one sample.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        position
            Measured now, shape (n_axes,) [m].
        command
            What acted since the last position, after any limit, shape (n_axes,).
        """
        regressor, wanted, filters = self.filtered(state.filters, position, command)
        residual = jnp.sum(regressor * state.free, axis=0) - wanted  # (2)
        spread = jnp.sum(state.covariance * regressor, axis=1)  # Γ y, shape (4, n_axes)
        # by component: XLA makes one loop of sums of products, and calls a library for dots
        size = jnp.sum(regressor * spread, axis=0)
        norm = 1.0 + self.normalisation * jnp.sum(size)
        step = self.sample_time / (norm + self.sample_time * size)
        learns = state.age >= self.settle
        step = jnp.where(learns, step, 0.0)
        free = state.free - step * spread * residual  # (4)
        covariance = state.covariance - step * spread[:, None, :] * spread[None, :, :]  # (4)
        below = self.norm(state.covariance) <= self.limit
        growth = jnp.exp(self.forgetting * self.sample_time)
        covariance = covariance * jnp.where(below & learns, growth, 1.0)
        if self.at_limit == "freeze":
            covariance = jnp.where(below, covariance, state.covariance)
        age = jnp.minimum(state.age + 1, jnp.asarray(self.settle, jnp.int32) + 1)
        return LeastSquaresState(
            filters,
            self.project(free),
            free,
            covariance,
            regressor,
            residual,
            age.astype(jnp.int32),
        )

    @staticmethod
    def norm(covariance: Array) -> AxisVector:
        """Return the Frobenius norm of each axis's Γ: λ_max at least, twice it at most.

        Parameters
        ----------
        covariance
            Shape (4, 4, n_axes).
        """
        return jnp.sqrt(jnp.sum(covariance**2, axis=(0, 1)))
