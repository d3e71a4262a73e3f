"""The local task frame: tangent and normal at the reference point.

    ε = J (q - q_d),    ε' = J (q' - q_d') + ψ' Q ε,    ψ' = κ s'                        (1)

with J = [tᵀ; nᵀ] at the reference point and ψ' the rate at which that frame turns, known from the
plan. What is taken for the contour error is the normal part of the tracking error.

Exact on straight lines. On a contour of curvature κ the tool may be on the contour and still have
ε_c = ∓ κ ε_m² / 2, ε_m being the error along the path: 2 µm at κ = 20 1/m take 0.45 mm of it. With
errors of a few µm there is no difference from :class:`GlobalTaskFrame` that could be measured.

The carried velocity and acceleration (:mod:`~contourlab.controllers.frames.coordinates`) are

    v_0  = q_d' - Jᵀ ψ' Q ε                                                              (2)
    v_0' = q_d'' - Jᵀ (ψ'' Q ε + ψ' Q ε' + ψ'² ε)                                        (3)

The frame itself is that of :class:`ReferenceFrame`, whose normal is to the left.

References
----------
.. [HuYaoWang] the law C3, of which the paper only says that it uses the local frame.
.. [ChiuTomizuka2001] the task coordinate frame; equation numbers not checked.
"""

from __future__ import annotations

import jax.numpy as jnp

from contourlab.configuration import part
from contourlab.contours.base import Contour
from contourlab.controllers.frames.coordinates import (
    BoundTaskFrame,
    TaskCoordinates,
    TaskFrame,
    quarter_turn,
    refuse_not_planar,
)
from contourlab.controllers.frames.reference_frame import ReferenceFrame
from contourlab.controllers.smooth_path import refuse_corners
from contourlab.recordings.sample import Sample
from contourlab.typing import AxisVector, Count, Scalar

__all__ = ["BoundLocalTaskFrame", "LocalTaskFrame"]


class LocalTaskFrame(TaskFrame):
    """Errors along and across the contour in the frame of the reference point; see the module.

    Parameters
    ----------
    rate_from
        ``"coordinates"`` or ``"velocity"``.
    """

    @property
    def derivatives(self) -> int:
        """3, for ψ''."""
        return 3

    @property
    def needs_contour(self) -> bool:
        """Never."""
        return False

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundLocalTaskFrame:
        """Return the frame of one contour.

        Parameters
        ----------
        contour
            A planar contour.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            A contour that is not planar, or has a corner.
        """
        refuse_not_planar(type(self).__name__, contour)
        refuse_corners(type(self).__name__, contour)
        frame = ReferenceFrame(n_axes=2, sample_time=sample_time, twist_limit=1.0, return_rate=1.0)
        return BoundLocalTaskFrame(rate_from=self.rate_from, sample_time=sample_time, frame=frame)


class BoundLocalTaskFrame(BoundTaskFrame):
    """The frame of one contour; made by :meth:`LocalTaskFrame.bind`."""

    frame: ReferenceFrame = part()

    def coordinates(self, sample: Sample, piece: Count) -> TaskCoordinates:
        """Return the coordinates with the rate that the measured velocity gives.

        Parameters
        ----------
        sample
            This instant.
        piece
            Not needed.
        """
        del piece
        reference = sample.reference
        motion, _ = self.frame.step((), sample)
        tangent, left = motion.rotation[:, 0], motion.rotation[:, 1]
        jacobian = jnp.stack([tangent, -left])
        turning, change = motion.turning[1, 0], motion.turning_rate[1, 0]
        error = jacobian @ (sample.position - reference.position)
        drift = turning * quarter_turn(error)
        rate = jacobian @ (sample.velocity - reference.velocity) + drift  # (1)
        terms = change * quarter_turn(error) + turning * quarter_turn(rate) + turning**2 * error
        return TaskCoordinates(
            error, rate, jacobian, turning,
            reference.velocity - drift @ jacobian,  # (2)
            reference.acceleration - terms @ jacobian,  # (3)
        )  # fmt: skip

    def with_rate(self, here: TaskCoordinates, rate: AxisVector) -> TaskCoordinates:
        """Return coordinates with another rate in place, on which (3) depends too.

        Parameters
        ----------
        here
            As ``coordinates`` returned them.
        rate
            ε' [m/s].
        """
        change = quarter_turn(rate - here.rate) * here.turning
        return TaskCoordinates(
            here.error, rate, here.jacobian, here.turning, here.carried_velocity,
            here.carried_acceleration - here.to_axes(change),
        )  # fmt: skip
