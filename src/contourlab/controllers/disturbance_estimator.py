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

which vanishes for a steady acceleration. Under a constant disturbance Δ goes to D.

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
The factor c in (25). Sampled: both filters are discretised exactly for inputs that are held between
samples. Stiffness. Ω starts at -V, which is 0 for an axis that starts at rest as in the paper.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import Configuration, real
from contourlab.machines.base import NominalModel
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["FORMS", "DisturbanceEstimator", "DisturbanceState"]

FORMS = ("corrected", "printed")
"""With and without the factor c in (25)."""


class DisturbanceState(NamedTuple):
    """What the estimator remembers, each of shape (n_axes,)."""

    lagging: AxisVector
    """Ω: minus the velocity, behind a low-pass [m/s]."""
    disturbance: AxisVector
    """Δ, in units of the command."""


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
    """

    inertia: Float[Array, " ..."] = real(ndim=1)
    viscous: Float[Array, " ..."] = real(ndim=1)
    stiffness: Float[Array, " ..."] = real(ndim=1)
    acceleration_scale: Float[Array, " ..."] = real(unit="1/s", ndim=1)
    velocity_decay: Float[Array, " ..."] = real(ndim=1, minimum=0.0, maximum=1.0)
    smoothing_decay: Float[Array, " ..."] = real(ndim=1, minimum=0.0, maximum=1.0)

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
            ``"corrected"``, or ``"printed"``: (25) as it stands in the paper.
        """
        gain = model.gain
        held = jnp.zeros_like(gain) if model.stiffness is None else model.stiffness / gain
        printed = form == "printed"
        return DisturbanceEstimator(
            inertia=model.mass / gain,
            viscous=model.viscous / gain,
            stiffness=held,
            acceleration_scale=jnp.ones_like(velocity_rate) if printed else velocity_rate,
            velocity_decay=jnp.exp(-velocity_rate * sample_time),
            smoothing_decay=jnp.exp(-smoothing_rate * sample_time),
        )

    def init(self, velocity: AxisVector) -> DisturbanceState:
        """Return the state of an axis that has moved at one velocity for a long time.

        Parameters
        ----------
        velocity
            Measured, shape (n_axes,) [m/s].
        """
        return DisturbanceState(-velocity, jnp.zeros_like(velocity))

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
        known = self.viscous * velocity + self.stiffness * position
        first = self.inertia * acceleration + known - applied  # (25)
        slow, smooth = self.velocity_decay, self.smoothing_decay
        return DisturbanceState(
            slow * state.lagging - (1.0 - slow) * velocity,  # (24)
            smooth * state.disturbance + (1.0 - smooth) * first,  # (26)
        )
