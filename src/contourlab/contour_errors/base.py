"""What a real-time contour error estimator is."""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx

from contourlab.configuration import Configuration
from contourlab.contours.base import Contour
from contourlab.errors import RefusedError
from contourlab.recordings.sample import Sample
from contourlab.typing import AxisVector, Scalar

__all__ = ["ContourEstimator", "Estimator", "EstimatorNeeds"]


class EstimatorNeeds(eqx.Module):
    """What an estimator asks of the loop; all static."""

    derivatives: int = eqx.field(static=True, default=1, kw_only=True)
    """Order of the contour derivatives in ``Sample.geometry``."""
    contour: bool = eqx.field(static=True, default=False, kw_only=True)
    """Whether it evaluates the contour itself, elsewhere than at the reference parameter."""
    coordinates: tuple[int, ...] = eqx.field(static=True, default=(), kw_only=True)
    """Numbers of coordinates of a contour that it can take; () means any."""


class Estimator(Configuration):
    """Estimates the contour error vector, from the actual position to the contour.

    An estimator works in tool space: on a machine with a tool map, the law that uses it hands it a
    sample whose ``position`` is the tool point. A stateless estimator writes ``estimate`` only; one
    that keeps a state writes ``init`` and ``step``, and ``bind`` if it evaluates the contour or
    depends on the sample time.
    """

    @property
    def needs(self) -> EstimatorNeeds:
        """What the estimator asks of the loop."""
        return EstimatorNeeds()

    def bind(self, contour: Contour, sample_time: Scalar) -> Estimator:
        """Return the estimator ready for one contour and sample time.

        Parameters
        ----------
        contour
            The path that the loop follows.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            The estimator is not defined on this contour; says why.
        """
        del sample_time
        allowed = self.needs.coordinates
        if allowed and contour.n_axes not in allowed:
            raise RefusedError(
                f"{type(self).__name__} is defined on contours with "
                f"{' or '.join(map(str, allowed))} coordinates, this one has {contour.n_axes}"
            )
        return self

    def init(self, sample: Sample) -> Any:
        """Return the state before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        del sample
        return ()

    def step(self, state: Any, sample: Sample) -> tuple[AxisVector, Any]:
        """Return the contour error vector [m] and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant, in tool space.
        """
        return self.estimate(sample), state

    @abc.abstractmethod
    def estimate(self, sample: Sample) -> AxisVector:
        """Return the contour error vector from one sample alone, shape (n_coordinates,) [m].

        Parameters
        ----------
        sample
            One instant, in tool space; the actual point is ``sample.position``.
        """


class ContourEstimator(Estimator):
    """One that evaluates the contour, elsewhere than at the reference: it is bound before use.

    ``bind`` returns a second class, which has an ``estimate`` of its own.
    """

    def estimate(self, sample: Sample) -> AxisVector:
        """Not possible before the contour is known.

        Parameters
        ----------
        sample
            One instant.

        Raises
        ------
        RefusedError
            Always: bind the estimator first.
        """
        raise RefusedError(
            f"{type(self).__name__} evaluates the contour: call bind(contour, sample_time) first"
        )
