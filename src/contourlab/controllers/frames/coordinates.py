"""What planar task frames have in common: errors along and across the contour, and their rates.

A task frame turns the measured position into two coordinates r = (r_m, r_c), along and across the
contour, and says how they move:

    e = r - r_d,    e' = J (q' - v_0),    J = [tᵀ; nᵀ]                                   (1)
    J' = ψ' Q J,    Q = [[0, -1], [1, 0]]

t is the tangent in the direction of travel, n the normal to its *right*, so that r_c has the sign
of the contour error; ψ' is the rate at which the frame turns, positive to the left. v_0 is the
velocity at which e would not change. A law that wants e' = e_eq' wants of the axes

    q_eq'  = v_0 + Jᵀ e_eq'                                                              (2)
    q_eq'' = v_0' + Jᵀ (e_eq'' - ψ' Q e_eq')                                             (3)

which is all that it has to know of the frame: with s = e' - e_eq' the axes' s is q' - q_eq' = Jᵀ s.

**How the rate is formed** is a choice, ``rate_from``:

``"coordinates"``
    (e_k - e_k-1) / T, the coordinate's own difference. It is late by T/2 and has no bias.
``"velocity"``
    the measured velocity, turned into the frame as it stands now (1). A velocity that is itself a
    difference of positions is that of the middle of the last interval, when the tangent pointed
    elsewhere: on a contour of curvature κ run at speed v it has, in the frame of now, a part
    T κ v² / 2 across the contour that is none. A law whose integral brings s = e' + Λ e to zero
    then holds the tool at

        r_c = -T κ v² / (2 Λ)                                                            (4)

    towards the centre of curvature, for ever. With a true velocity there is no bias.

References
----------
.. [HuYaoWang] (2), (3) and the paragraph before (10), in the order (normal, tangential).

Differences from the paper
--------------------------
The order of the coordinates, which is that of the other laws of the house; (2) and (3) in axes,
where the paper writes everything in the frame. The paper does not say how the rate is formed.
"""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import Configuration, real, static
from contourlab.contours.base import Contour
from contourlab.errors import RefusedError
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = [
    "BoundTaskFrame",
    "RateState",
    "TaskCoordinates",
    "TaskFrame",
    "quarter_turn",
    "refuse_not_planar",
]

RATES = ("coordinates", "velocity")


def quarter_turn(components: Float[Array, " 2"]) -> Float[Array, " 2"]:
    """Return Q x = (-x_2, x_1).

    Parameters
    ----------
    components
        Along and across the contour.
    """
    return jnp.stack([-components[1], components[0]])


class TaskCoordinates(eqx.Module):
    """Where the tool is in a task frame at one instant, and how the frame moves."""

    error: Float[Array, " 2"]
    """e: along the contour, > 0 ahead of the reference, and across it, > 0 on the right [m]."""
    rate: Float[Array, " 2"]
    """e' [m/s]."""
    jacobian: Float[Array, "2 2"]
    """J; its rows are t and n, so that its transpose is its inverse."""
    turning: Scalar
    """ψ', > 0 to the left [rad/s]."""
    carried_velocity: AxisVector
    """v_0, in axes [m/s]."""
    carried_acceleration: AxisVector
    """v_0', in axes [m/s²]."""

    @property
    def contour_error(self) -> AxisVector:
        """The contour error vector, from the tool to the contour, in axes [m]."""
        return -self.error[1] * self.jacobian[1]

    def to_axes(self, components: Float[Array, " 2"]) -> AxisVector:
        """Return Jᵀ x.

        Parameters
        ----------
        components
            Along and across.
        """
        return components[0] * self.jacobian[0] + components[1] * self.jacobian[1]

    def from_axes(self, vector: AxisVector) -> Float[Array, " 2"]:
        """Return J x.

        Parameters
        ----------
        vector
            Shape (2,).
        """
        return jnp.stack([self.jacobian[0] @ vector, self.jacobian[1] @ vector])

    def equivalent_motion(
        self, rate: Float[Array, " 2"], change: Float[Array, " 2"]
    ) -> tuple[AxisVector, AxisVector]:
        """Return the velocity and the acceleration of the axes that an error's course asks for.

        Parameters
        ----------
        rate
            e_eq' [m/s].
        change
            e_eq'' [m/s²].
        """
        velocity = self.carried_velocity + self.to_axes(rate)  # (2)
        turned = change - self.turning * quarter_turn(rate)
        return velocity, self.carried_acceleration + self.to_axes(turned)  # (3)


class RateState(NamedTuple):
    """What a task frame remembers."""

    error: Float[Array, " 2"]
    """The last e [m]."""
    known: Count
    """Whether there was one; int32."""
    piece: Count
    """Piece of the contour that the reference was on; int32."""


class TaskFrame(Configuration):
    """Configuration of a planar task frame; see the module."""

    rate_from: str = static(allowed=RATES, default="coordinates")
    """``"coordinates"``: their difference; ``"velocity"``: the measured one, turned."""

    @property
    @abc.abstractmethod
    def derivatives(self) -> int:
        """Order of the contour's derivatives at the reference parameter that the frame needs."""

    @property
    @abc.abstractmethod
    def needs_contour(self) -> bool:
        """Whether the frame evaluates the contour elsewhere."""

    @abc.abstractmethod
    def bind(self, contour: Contour, sample_time: Scalar) -> BoundTaskFrame:
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


class BoundTaskFrame(Configuration):
    """A task frame of one contour: pure functions of a state and a sample."""

    rate_from: str = static(allowed=RATES)
    sample_time: Scalar = real(unit="s", above=0.0)

    def init(self, sample: Sample) -> RateState:
        """Return the state before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        zero = jnp.zeros((), jnp.int32)
        return RateState(jnp.zeros_like(sample.position), zero, self.locate(sample, zero))

    def step(self, state: RateState, sample: Sample) -> tuple[TaskCoordinates, RateState]:
        """Return the coordinates of the measured position, and the new state.

        At the first step there is no difference yet: the rate is that of the velocity.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """
        piece = self.locate(sample, state.piece)
        here = self.coordinates(sample, piece)
        if self.rate_from == "coordinates":
            difference = (here.error - state.error) / self.sample_time
            rate = jnp.where(state.known > 0, difference, here.rate)
            here = self.with_rate(here, rate)
        return here, RateState(here.error, jnp.ones((), jnp.int32), piece)

    def locate(self, sample: Sample, piece: Count) -> Count:
        """Return the piece that holds the reference parameter; for frames that need none, 0.

        Parameters
        ----------
        sample
            This instant.
        piece
            Where to look first.
        """
        del sample
        return piece

    @abc.abstractmethod
    def coordinates(self, sample: Sample, piece: Count) -> TaskCoordinates:
        """Return the coordinates with the rate that the measured velocity gives.

        Parameters
        ----------
        sample
            This instant.
        piece
            As ``locate`` returned it.
        """

    def with_rate(self, here: TaskCoordinates, rate: Float[Array, " 2"]) -> TaskCoordinates:
        """Return coordinates with another rate in place.

        Parameters
        ----------
        here
            As ``coordinates`` returned them.
        rate
            e' [m/s].
        """
        return eqx.tree_at(lambda c: c.rate, here, rate)  # type: ignore[no-any-return]


def refuse_not_planar(name: str, contour: Any) -> None:
    """Raise RefusedError unless a contour has two coordinates."""
    if contour.n_axes != 2:
        raise RefusedError(
            f"{name} is a frame in the plane: it needs a contour of 2 coordinates, this one has "
            f"{contour.n_axes}"
        )
