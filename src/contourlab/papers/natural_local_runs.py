"""Runs of the natural local laws of Meng, Lou and Zhou: the helix and the emulated stage.

References
----------
.. [MengLouZhou] section IV, (26).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from contourlab.contours.base import ClosedFormContour
from contourlab.contours.circle import TURN
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.figure_eight import FigureEight
from contourlab.controllers import FirstOrderTaskFrame, NaturalLocalTaskFrame
from contourlab.controllers.task_frame import TaskFrameController
from contourlab.feedrate import constant_rate
from contourlab.machines.published.meng import meng_emulated_stage, meng_simulated_axes
from contourlab.recordings import Recording
from contourlab.recordings.reference import Reference
from contourlab.simulation import simulate
from contourlab.typing import Count, Derivatives, Scalar

__all__ = ["FIRST", "NATURAL", "MengHelix", "helix_run", "stage_reference", "stage_run"]

AS_PRINTED: dict[str, Any] = {"friction_from": "measured", "hold_compensation": False}
"""Fields that make the laws those of the paper."""
PAPER_ESTIMATE: dict[str, Any] = {**AS_PRINTED, "estimate": "natural", "curvature_rates": False}
FIRST, NATURAL = "first_order_task_frame", "natural_local_task_frame"


class MengHelix(ClosedFormContour):
    """x = 0.03 cos p, y = 0.01 sin p, z = 0.1 p / 2π [m], (26) with p = ωt; five turns."""

    @property
    def n_axes(self) -> int:
        """3."""
        return 3

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """0 to five turns [rad]: past the end of the experiment."""
        return 0.0, 5.0 * TURN

    @property
    def closed(self) -> bool:
        """Never."""
        return False

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the angle, in closed form.

        Parameters
        ----------
        parameter
            p [rad].
        order
            Highest derivative, >= 0.
        piece
            Not needed.
        """
        del piece
        rows = []
        climb = (0.1 / TURN * jnp.asarray(parameter), jnp.asarray(0.1 / TURN))
        for k in range(order + 1):
            angle = parameter + 0.5 * np.pi * k
            z = climb[k] if k < 2 else jnp.zeros(())
            rows.append(jnp.stack([0.03 * jnp.cos(angle), 0.01 * jnp.sin(angle), z]))
        return jnp.stack(rows)


@functools.cache
def _helix_reference(sample_time: float) -> Reference:
    return constant_rate(MengHelix(), rate=2.0 * np.pi, duration=4.0, sample_time=sample_time)


def helix_run(
    law: str,
    bandwidth_hz: Sequence[float],
    *,
    viscous_z: float = 180.0,
    sample_time: float = 1e-3,
    hold_compensation: bool = False,
) -> Recording:
    """Run four turns of the helix.

    Parameters
    ----------
    law
        ``"first_order_task_frame"`` or ``"natural_local_task_frame"``, as the paper has them.
    bandwidth_hz
        Tangential, normal, binormal [Hz].
    viscous_z
        What the law is told of z [1/s].
    sample_time
        [s].
    hold_compensation
        Whether the command allows for being held, which the paper's does not.
    """
    machine = meng_simulated_axes(viscous_z=viscous_z)
    controller = _law(law, machine.nominal, bandwidth_hz, hold_compensation=hold_compensation)
    return simulate(machine, controller, _helix_reference(sample_time))


def _law(
    law: str, model: Any, bandwidth_hz: Sequence[float], **changes: Any
) -> TaskFrameController:
    bandwidth = np.asarray(bandwidth_hz)
    if law == FIRST:
        return FirstOrderTaskFrame(model=model, bandwidth_hz=bandwidth, **(AS_PRINTED | changes))
    fields = PAPER_ESTIMATE | changes
    return NaturalLocalTaskFrame(model=model, bandwidth_hz=bandwidth, **fields)


@functools.cache
def stage_reference(contour: str, sample_time: float = 1e-3) -> Reference:
    """Return two rounds of one of the contours on the stage, begun with a velocity step.

    Parameters
    ----------
    contour
        ``"ellipse"`` or ``"figure of eight"``.
    sample_time
        [s].
    """
    if contour == "ellipse":  # x = 0.03 (1 - cos ωt), y = 0.01 sin ωt, ω = 1.8 π
        curve: Any = Ellipse(semi_axes=np.array((0.03, 0.01)), center=np.array((0.03, 0.0)))
        omega, start = -1.8 * np.pi, np.pi
    else:  # y = 0.03 sin 2ωt, ω = π
        curve = FigureEight(half_sizes=np.array((0.03, 0.03)), center=np.array((0.03, 0.0)))
        omega, start = np.pi, 0.0
    return constant_rate(
        curve, rate=omega, start=start, duration=2.0 * TURN / abs(omega), sample_time=sample_time
    )


def stage_run(contour: str, law: str, normal_hz: float) -> Recording:
    """Run two rounds of a contour on the emulated stage, f_t = 15 Hz.

    Parameters
    ----------
    contour
        ``"ellipse"`` or ``"figure of eight"``.
    law
        As for :func:`helix_run`.
    normal_hz
        f_n [Hz].
    """
    machine = meng_emulated_stage()
    controller = _law(law, machine.nominal, (15.0, normal_hz))
    return simulate(machine, controller, stage_reference(contour))
