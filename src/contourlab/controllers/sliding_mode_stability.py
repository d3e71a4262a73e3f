"""Whether sliding mode control, sampled, is stable inside its boundary layer.

Inside the layer the law is linear. On the nominal model, whose motion under a held command is known
exactly, one sample maps position, velocity, integral and the states of the disturbance estimate
linearly onto themselves; the loop is stable if every eigenvalue of that map is within the unit
circle. Runs once when a law is bound, on the host.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from contourlab.errors import RefusedError
from contourlab.machines.base import NominalModel

if TYPE_CHECKING:
    from contourlab.controllers.integral_sliding_mode import BoundIntegralSlidingMode

__all__ = ["refuse_unstable", "sampled_map"]


def sampled_map(
    law: BoundIntegralSlidingMode, model: NominalModel, sample_time: float, axis: int
) -> NDArray[Any]:
    """Return what one sample does to P, V, q, Ω, Δ and the rest of (M), inside the layer.

    Parameters
    ----------
    law
        The bound law.
    model
        The axes.
    sample_time
        Time between samples [s].
    axis
        Which.

    Returns
    -------
    numpy.ndarray
        Shape (6, 6); (5, 5) where the estimate is not matched, (3, 3) without one.
    """

    def of(value: Any) -> float:
        return float(np.asarray(value)[axis])

    mass, gain = of(model.mass), of(model.gain)
    stiffness = 0.0 if model.stiffness is None else of(model.stiffness)
    a, b, kappa = of(law.error_rate), of(law.integral_rate), of(law.switching_gain)
    surface = np.array([-a, -1.0, b, 0.0, 0.0, 0.0])
    error = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    rate = np.array([0.0, -1.0, 0.0, 0.0, 0.0, 0.0])
    command = of(law.velocity_gain) * rate + of(law.position_gain) * error + kappa * surface
    command[0] += stiffness / gain
    command[4] -= law.estimated
    system = np.zeros((3, 3))
    system[0, 1] = 1.0
    system[1] = np.array([-stiffness, -of(model.viscous), gain]) / mass
    held = expm(system * sample_time)
    step = np.zeros((6, 6))
    step[:2, :2] = held[:2, :2]
    step[:2] += np.outer(held[:2, 2], command)
    decay = of(law.decay)
    step[2] = (1.0 - decay) / b * surface
    step[2, 2] += decay
    if not law.estimated:
        return step[:3, :3]
    estimator = law.estimator
    slow, smooth = of(estimator.velocity_decay), of(estimator.smoothing_decay)
    step[3, 1], step[3, 3] = slow - 1.0, slow
    known = -command
    known[:2] += of(estimator.stiffness), of(estimator.viscous)
    first = known
    if estimator.matched:
        step[5] = (1.0 - slow) * known
        step[5, 5] += slow
        first = np.zeros(6)
        first[5] = 1.0
    first[[1, 3]] += of(estimator.inertia) * of(estimator.acceleration_scale)
    step[4] = (1.0 - smooth) * first
    step[4, 4] += smooth
    return step if estimator.matched else step[:5, :5]


def refuse_unstable(law: BoundIntegralSlidingMode, model: NominalModel, sample_time: float) -> None:
    """Raise RefusedError if the sampled loop is not stable inside the boundary layer.

    Parameters
    ----------
    law
        The bound law.
    model
        The axes as the law believes them.
    sample_time
        Time between samples [s].
    """
    for axis in range(model.n_axes):
        radius = np.max(np.abs(np.linalg.eigvals(sampled_map(law, model, sample_time, axis))))
        if not radius < 1.0:
            pole = float(np.asarray(law.switching_gain * model.gain / model.mass)[axis])
            raise RefusedError(
                f"IntegralSlidingMode on axis {axis} (counted from 0) is not stable at a sample "
                f"time of {sample_time:g} s: inside its boundary layer an eigenvalue of the "
                f"sampled loop has the magnitude {radius:.4g}, the layer's own pole being at "
                f"{pole:.4g} 1/s. Lower the switching gain (with a thicker boundary_layer) or the "
                "rates, or sample faster"
            )
