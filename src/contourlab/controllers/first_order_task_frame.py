"""Contouring control in the local task frame, the contour taken for its tangent line.

    f'' = -KP f - KD f',    KP = diag((2π f_i)²), KD = diag(4π ζ_i f_i),   i = t, n, b

The normal and binormal parts of the tracking error are taken for the contour error and held down by
bandwidths of their own, while the part along the path may be left soft. What all such laws share
stands in :mod:`~contourlab.controllers.task_frame`.

Exact on straight lines. On a contour of curvature κ the law brings n to zero, not the contour
error: what remains is κ t² / 2, with t the error along the path, whatever the normal bandwidth.
Good where the lag t is small or the path is nearly straight; on a curve with a soft t see
:class:`NaturalLocalTaskFrame`.

References
----------
.. [ChiuTomizuka2001] the task coordinate frame; equation numbers not checked.
.. [MengLouZhou] the law as they compare with it: (20) and (25) with z = f.

Differences from the papers
---------------------------
Command for a held sample, Coulomb friction along the reference, and a frame on straight stretches
in space: see the modules.
"""

from __future__ import annotations

from contourlab.contours.base import Contour
from contourlab.controllers.frames import FrameMotion
from contourlab.controllers.task_frame import BoundTaskFrameController, TaskFrameController
from contourlab.typing import AxisVector, Scalar

__all__ = ["BoundFirstOrderTaskFrame", "FirstOrderTaskFrame"]


class FirstOrderTaskFrame(TaskFrameController):
    """PD with feedback linearisation along tangent, normal and binormal; see the module.

    Parameters
    ----------
    model
        Nominal model of 2 or 3 axes.
    bandwidth_hz
        f > 0 [Hz], (tangential, normal) or, in space, (tangential, normal, binormal); with two in
        space the binormal has that of the normal.
    damping
        ζ > 0, one number or one per direction.
    friction_compensation
        Share, 0 to 1, of the model's Coulomb friction that is compensated.
    friction_velocity
        Width of the smooth sign, > 0 [m/s].
    friction_from
        Whose sign: ``"reference"`` or ``"measured"`` velocity.
    hold_compensation
        Whether the command allows for being held over the sample time.

    Raises
    ------
    ConfigurationError
        A value out of bounds, or a wrong number of them.
    RefusedError
        The model is commanded by positions.
    """

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundFirstOrderTaskFrame:
        """Return the law for one contour and sample time.

        Parameters
        ----------
        contour
            The path that the loop follows.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            The contour has a corner, or not one coordinate per axis.
        ConfigurationError
            A damping or friction setting of the wrong number.
        """
        return BoundFirstOrderTaskFrame(**self.bound_fields(contour, sample_time))


class BoundFirstOrderTaskFrame(BoundTaskFrameController):
    """The discretised law; made by :meth:`FirstOrderTaskFrame.bind`."""

    def acceleration(
        self, motion: FrameMotion, error: AxisVector, rate: AxisVector
    ) -> tuple[AxisVector, AxisVector]:
        """Return f itself, and the acceleration that the law wants.

        Parameters
        ----------
        motion
            Not used: the contour is a line.
        error, rate
            f and f', shape (n_axes,).
        """
        del motion
        return error, -self.stiffness_gain * error - self.damping_gain * rate
