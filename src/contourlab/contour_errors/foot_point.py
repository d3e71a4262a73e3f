"""Contour error from the exact foot point of the measured position.

The estimate is no estimate: the vector runs from the actual point to the nearest point of the
contour, the *local* one by which recordings are judged (``contours.local_foot``): on the connected
stretch around the reference parameter that stays within twice the tracking error of the reference
point. Exact always, to rounding, on every contour and in any number of coordinates: at corners, at
the ends of an open contour (where the foot is the end point), at lags beyond the radius of
curvature.

It fails with the measurement only: what the encoder does not see it does not see. Where two feet
are equally near, and at the centre of a circle, the vector jumps from one to the other.

Cost. A line or an arc of a path has a closed form. On formula contours and Béziers a quick search
by Newton's method is tried first, accepted where a table made by ``bind`` shows the foot to be
unique; otherwise the stretch is searched cell by cell with certified bounds. The number of cells
grows with the tracking error, up to once round the whole contour twice over: there is no bound on
the time of a step that a servo loop could rely on. On a real machine use it as the judge of others;
in the loop take :class:`NewtonEstimator` in its converged form, which has a fixed count.

``near`` says around which parameter the stretch is laid:

``"reference"`` (the default)
    The reference parameter. The estimate equals the recording's contour error of the measured
    position.

``"last_foot"``
    The foot of the sample before; the reference parameter at the first. The foot keeps to the
    branch on which the tool is, however far the reference is ahead. If the tool is carried across
    to another branch in one sample the two disagree, and stay so.

Nothing here is from a paper: it is the definition, solved in
:mod:`contourlab.contours.foot_points.local`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from contourlab.configuration import part, static
from contourlab.contour_errors.base import ContourEstimator, Estimator, EstimatorNeeds
from contourlab.contours.base import Contour
from contourlab.contours.foot_points import cells_of, local_foot
from contourlab.recordings.sample import Sample
from contourlab.typing import AxisVector, Count, Scalar

__all__ = ["FootPointEstimator"]


class FootPointState(NamedTuple):
    """What the estimator remembers."""

    parameter: Scalar
    """Where the stretch of the last sample was laid, or its foot; inside the domain."""
    piece: Count
    """Piece of the contour that holds it, int32."""


class FootPointEstimator(ContourEstimator):
    """The exact contour error vector of the measured position; see the module.

    Parameters
    ----------
    near
        ``"reference"``: search around the reference parameter; ``"last_foot"``: around the foot of
        the sample before.
    """

    near: str = static(allowed=("reference", "last_foot"), default="reference")

    @property
    def needs(self) -> EstimatorNeeds:
        """The contour itself, and no derivatives at the reference parameter."""
        return EstimatorNeeds(derivatives=0, contour=True)

    def bind(self, contour: Contour, sample_time: Scalar) -> Estimator:
        """Return the estimator for one contour, cut into cells.

        Parameters
        ----------
        contour
            The path that the loop follows.
        sample_time
            Time between samples [s].
        """
        super().bind(contour, sample_time)
        return BoundFootPointEstimator(near=self.near, contour=contour, cells=cells_of(contour))


class BoundFootPointEstimator(FootPointEstimator):
    """The estimator with its contour; made by :meth:`FootPointEstimator.bind`."""

    contour: Contour = part()
    cells: Any = part()

    def init(self, sample: Sample) -> FootPointState:
        """Return the state before the first step: at the reference point.

        Parameters
        ----------
        sample
            The first sample.
        """
        return self._at(sample.reference.parameter, jnp.zeros((), jnp.int32))

    def step(self, state: FootPointState, sample: Sample) -> tuple[AxisVector, FootPointState]:
        """Return the contour error vector [m] and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant, in tool space.
        """
        if self.near == "reference":
            state = self._at(sample.reference.parameter, state.piece)
        foot = local_foot(self.cells, sample.position, state.parameter, state.piece)
        if self.near == "last_foot":
            state = self._at(foot.parameter, state.piece)
        return foot.vector, state

    def estimate(self, sample: Sample) -> AxisVector:
        """Return the contour error vector from one sample alone, shape (n_coordinates,) [m].

        Parameters
        ----------
        sample
            One instant, in tool space.
        """
        return self.step(self.init(sample), sample)[0]

    def _at(self, parameter: Scalar, piece: Count) -> FootPointState:
        # the stretch is chosen, not differentiated through
        parameter = jax.lax.stop_gradient(self.contour.wrap(jnp.asarray(parameter, float)))
        return FootPointState(parameter, self.contour.locate(parameter, piece))
