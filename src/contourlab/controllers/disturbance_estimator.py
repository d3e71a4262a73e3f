"""The disturbance on every axis, from command and velocity: Ghaffari and Ulsoy's estimator.

An axis obeys M V' + B V + S P = K (T + D), so that D would be known if V' were. V' is taken from
the measured velocity through a filter, and the result is smoothed:

    Ω' = -c Ω - c V                                               (24)
    ξ  = (M/K) c (Ω + V) + (B V + S P) / K - T                    (25)
    Δ' = -d Δ + d ξ                                               (26)

c (Ω + V) is V behind c s / (s + c): its derivative, c in 1/s being the cut-off. With M = τ, B = 1,
S = 0 and K = k this is the paper's (25), but for the factor c. In place of V' it sees V' late by
about 1/c, so that

    ξ = D - (M/K) s² / (s + c) V                                  (E)

which vanishes for a steady acceleration. Under a constant disturbance Δ goes to D. On a reference
with jerk r''' there is a bias of (M/K) r'''/c, which does harm where it exceeds what the law has in
hand: raise c, or take the form ``"matched"``, in which the rest of (25) passes the filter too,

    ξ = (M/K) c (Ω + V) + [(B V + S P) / K - T] behind c / (s + c)   (M)

so that ξ is D behind c / (s + c) whatever the axis does, and Δ is D behind c d / ((s+c) (s+d)).

The paper prints (25) without the factor c. What then stands for V' is too small by c (25 with the
paper's numbers, and of another dimension), so that Δ is off by (1 - 1/c) (M/K) V' while an axis
accelerates. That form is kept, as ``"printed"``, because it is the one that gives the paper's
figures; c is to be in 1/s.

T is the command that was really applied, with everything that other laws added and after the limit:
otherwise Δ would take the cross-coupling for a disturbance, and cancel it.

References
----------
.. [GhaffariUlsoy] section III, equations (24) to (26).

Differences from the paper
--------------------------
The factor c in (25), and (M). Sampled: both filters are discretised exactly for inputs that are
held between samples; in (M) acceleration and velocity are means over a sample. Stiffness. Ω starts
at -V, which is 0 for an axis that starts at rest as in the paper.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import Configuration, real, static
from contourlab.machines.base import NominalModel
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["FORMS", "DisturbanceEstimator", "DisturbanceState"]

FORMS = ("corrected", "matched", "printed")
"""(25) with its factor c; (M); (25) as it stands in the paper."""


class DisturbanceState(NamedTuple):
    """What the estimator remembers, each of shape (n_axes,)."""

    lagging: AxisVector
    """Ω: minus the velocity, behind a low-pass [m/s]."""
    disturbance: AxisVector
    """Δ [command unit]."""
    rest: AxisVector
    """Of (M): what the motion takes, less the command, behind the low-pass; else 0."""


class DisturbanceEstimator(Configuration):
    """The discretised estimator.

    Parameters
    ----------
    inertia
        M / K, command per acceleration, shape (n_axes,).
    viscous
        B / K, command per velocity, shape (n_axes,).
    stiffness
        S / K, command per position, shape (n_axes,).
    acceleration_scale
        What Ω + V is multiplied by to be an acceleration [1/s]: c, or 1 in the printed form.
    velocity_decay, smoothing_decay
        exp(-c T) and exp(-d T).
    matched
        Whether the rest of (25) passes the filter too.
    """

    inertia: Float[Array, " ..."] = real(unit="command unit per m/s^2", ndim=1)
    viscous: Float[Array, " ..."] = real(unit="command unit per m/s", ndim=1)
    stiffness: Float[Array, " ..."] = real(unit="command unit per m", ndim=1)
    acceleration_scale: Float[Array, " ..."] = real(unit="1/s", ndim=1)
    velocity_decay: Float[Array, " ..."] = real(unit="1", ndim=1, minimum=0.0, maximum=1.0)
    smoothing_decay: Float[Array, " ..."] = real(unit="1", ndim=1, minimum=0.0, maximum=1.0)
    matched: bool = static(flag=True, default=False)

    @staticmethod
    def of_model(
        model: NominalModel,
        velocity_rate: AxisVector,
        smoothing_rate: AxisVector,
        sample_time: Scalar,
        form: str = "corrected",
    ) -> DisturbanceEstimator:
        """Return the estimator for a model and a sample time.

        Parameters
        ----------
        model
            The nominal model.
        velocity_rate, smoothing_rate
            c and d, shape (n_axes,) [1/s].
        sample_time
            Time between samples [s].
        form
            One of :data:`FORMS`.
        """
        gain = model.gain
        held = jnp.zeros_like(gain) if model.stiffness is None else model.stiffness / gain
        inertia, viscous = model.mass / gain, model.viscous / gain
        decay, scale = jnp.exp(-velocity_rate * sample_time), velocity_rate
        if form == "printed":
            scale = jnp.ones_like(velocity_rate)
        if form == "matched":
            # of means over a sample: the low-pass of (V+ - V) / T, and V + (V+ - V) / 2
            scale = (1.0 - decay) / sample_time
            inertia = inertia + 0.5 * sample_time * viscous
        return DisturbanceEstimator(
            inertia=inertia,
            viscous=viscous,
            stiffness=held,
            acceleration_scale=scale,
            velocity_decay=decay,
            smoothing_decay=jnp.exp(-smoothing_rate * sample_time),
            matched=form == "matched",
        )

    def init(self, velocity: AxisVector) -> DisturbanceState:
        """Return the state of an axis that has moved at one velocity for a long time.

        Parameters
        ----------
        velocity
            Measured, shape (n_axes,) [m/s].
        """
        zero = jnp.zeros_like(velocity)
        return DisturbanceState(-velocity, zero, zero)

    def step(
        self,
        state: DisturbanceState,
        position: AxisVector,
        velocity: AxisVector,
        applied: AxisVector,
    ) -> DisturbanceState:
        """Return the state at the next sample.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        position, velocity
            Measured now [m], [m/s].
        applied
            The command that acts until the next sample, less what is known to be needed for
            something that the model does not hold, such as friction that is fed forward.
        """
        acceleration = self.acceleration_scale * (state.lagging + velocity)
        known = self.viscous * velocity + self.stiffness * position - applied
        slow, smooth = self.velocity_decay, self.smoothing_decay
        rest = slow * state.rest + (1.0 - slow) * known if self.matched else state.rest
        # (25), or (M) with what is known until now
        first = self.inertia * acceleration + (state.rest if self.matched else known)
        return DisturbanceState(
            slow * state.lagging - (1.0 - slow) * velocity,  # (24)
            smooth * state.disturbance + (1.0 - smooth) * first,  # (26)
            rest,
        )
