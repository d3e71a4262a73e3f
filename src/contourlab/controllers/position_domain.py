"""The position domain: where on the path the master axis is, from its measured position.

A law in the position domain asks not where the reference is now, but where on the path the master
is, and sends the other axes there. That place is the contour parameter p with m(p) = y, m being the
master's coordinate and y its position. Two kinds of master have one (Assumptions 3.1 and 3.2):

*monotone*, m only rises or only falls: p is the root of m(p) = y, found by Newton's method from
where it was expected;

*rotational*, a coordinate that swings between the same two ends: m(p) = y has a root on every
swing, and the one near the expected place is meant. (6), y = R cos θ, is of this kind, θ being the
parameter of a circle.

**Turning points.** At the ends of a swing m' = 0, and y says nothing about p: an error of 1e-6 R in
y (noise, or an amplitude that is not quite R) moves the root by 1e-3 rad. Two conversions:

``"tracked"`` (the default): p is carried on as the reference goes on, and corrected by what y says,
weighted by how well it says it:

    p ← p + (y - m(p)) m'(p) / (m'(p)² + (ε S)²),    S = max |m'|                       (P)

ε being the ``turning_width``: within about ε of a turning point, as a share of the swing, the lag
stays what it was. Away from it (P) is Newton's step. What remains of an error in p is multiplied by
(ε S)² / (m'² + (ε S)²) at each of two steps a sample, so that a constant lag leaves no error at
all; a measured error σ moves p by at most σ / (ε S) [parameter]. A monotone master is found by the
same step, taken five times: where its slope is not small the root is met to rounding, and where it
vanishes (half a circle begins and ends so) it is a turning point like any other.

``"arccos"``: Algorithm 3.1 with its start and its turning points put right, for masters with
m(p) = c + R cos(κ p + φ): θ is the angle with R cos θ = y - c that lies nearest to the expected
one, y - c clipped to ± R. Exact for exact positions of exactly that amplitude.

As printed (:func:`convert_as_printed`) the algorithm starts on the branch on which y falls,
whatever y does, and sees a turning point when the angle falls, one sample late where the turn lies
in the second half of an interval. The nearest angle needs neither.

References
----------
.. [CaoZhang] section 3, (2) to (10), Algorithm 3.1.
.. [Ouyang2012] control in the position domain of a monotone master; the paper was not at hand,
   equation numbers not checked.

Differences from the paper
--------------------------
The rotational variable is the contour's own parameter ("the pair (g1, θ) is not unique"), so that
any contour will do; (P); the nearest angle.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, part, real, static
from contourlab.contours.base import Contour
from contourlab.controllers.master import MasterMotion
from contourlab.typing import Array, AxisVector, Count, Scalar, Series

__all__ = ["PositionDomain", "PositionDomainState", "convert_as_printed", "nearest_angle"]

CORRECTIONS = 2
"""Steps (P) in a sample."""
NEWTON_STEPS = 5
"""For a monotone master: the error is squared in each, from a lag that is short beside the path."""
LONGEST_STEP = 0.125
"""Of a correction, as a share of the path's parameter range."""


class PositionDomainState(NamedTuple):
    """What is remembered."""

    parameter: Scalar
    """Where on the path the master is."""
    reference: Scalar
    """Contour parameter of the reference at that instant."""
    piece: Count
    """Piece of the contour, int32."""


class PositionDomain(Configuration):
    """From the master's position to the place on the path; made by :func:`position_domain`."""

    path: Contour = part()
    """In the space of the axes."""
    motion: MasterMotion = part()
    """How the master's coordinate runs along it."""
    turning_width: Float[Array, ""] = real(above=0.0, below=1.0)
    """ε of (P)."""
    conversion: str = static(allowed=("tracked", "arccos"))

    def init(self, parameter: Scalar) -> PositionDomainState:
        """Return the state of a master that is where the reference is.

        Parameters
        ----------
        parameter
            Of the reference.
        """
        piece = self.path.locate(parameter, jnp.zeros((), jnp.int32))
        start = jnp.asarray(parameter, float)
        return PositionDomainState(start, start, jnp.asarray(piece, jnp.int32))

    def step(
        self, state: PositionDomainState, position: Scalar, reference: Scalar
    ) -> PositionDomainState:
        """Return where the master is.

        Parameters
        ----------
        state
            One sample before.
        position
            Of the master [m].
        reference
            Contour parameter of the reference at the same instant.
        """
        p = state.parameter + (reference - state.reference)
        piece = state.piece
        axis = self.motion.axis
        if self.conversion == "arccos":
            motion = self.motion
            cosine = (position - motion.centre) / motion.amplitude
            angle = nearest_angle(cosine, motion.angle_rate * p + motion.phase)
            p = (angle - motion.phase) / motion.angle_rate
            return PositionDomainState(p, jnp.asarray(reference, float), self._locate(p, piece))
        steps = CORRECTIONS if self.motion.rotational else NEWTON_STEPS
        damping = (self.turning_width * self.motion.steepest) ** 2
        start, end = (jnp.asarray(edge, float) for edge in self.path.domain)
        longest = LONGEST_STEP * jnp.abs(end - start)
        for _ in range(steps):
            piece = self._locate(p, piece)
            rows = self.path.derivatives(p, 1, piece)
            off, slope = position - rows[0, axis], rows[1, axis]
            step = off * slope / (slope * slope + damping)  # (P)
            p = p + jnp.clip(step, -longest, longest)
        return PositionDomainState(p, jnp.asarray(reference, float), self._locate(p, piece))

    def follow(self, state: PositionDomainState) -> tuple[AxisVector, AxisVector]:
        """Return where every axis belongs, and its slope over the parameter, shape (n_axes,) each.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        rows = self.path.derivatives(state.parameter, 1, state.piece)
        return rows[0], rows[1]

    def _locate(self, parameter: Scalar, piece: Count) -> Count:
        return jnp.asarray(self.path.locate(parameter, piece), jnp.int32)


def nearest_angle(cosine: Scalar, near: Scalar) -> Scalar:
    """Return the angle with a given cosine that lies nearest to an expected one [rad].

    Every angle with cos θ = c is 2π n ± arccos c; (8) of Lemma 3.1 is the same, branch by branch.

    Parameters
    ----------
    cosine
        Clipped to -1 to 1.
    near
        Expected angle [rad].
    """
    inside = jnp.clip(cosine, -1.0, 1.0)
    # arccos by arctan2: the slope of arccos is infinite at the ends
    own = jnp.arctan2(jnp.sqrt(jnp.maximum((1.0 - inside) * (1.0 + inside), 1e-300)), inside)
    turn = 2.0 * np.pi
    up = own + turn * jnp.round((near - own) / turn)
    down = -own + turn * jnp.round((near + own) / turn)
    return jnp.where(jnp.abs(up - near) <= jnp.abs(down - near), up, down)


def convert_as_printed(position: Series, radius: float, *, decreasing: bool = False) -> Series:
    """Return Algorithm 3.1 as it is printed, on a whole record.

    Right for a position that starts on a branch on which it falls; see the module.

    Parameters
    ----------
    position
        y1, shape (n_samples,).
    radius
        R = sup |y1|.
    decreasing
        Whether the angle falls (Remark 3.2).
    """
    angle = np.zeros(len(position))
    branch = -1 if decreasing else 0
    for k, y in enumerate(np.arccos(np.clip(np.asarray(position) / radius, -1.0, 1.0))):
        for _ in range(2):
            sign = (-1.0) ** branch
            angle[k] = branch * np.pi + 0.5 * np.pi * (1.0 - sign) + sign * y  # lines 2 and 5
            back = angle[k] > angle[k - 1] if decreasing else angle[k] < angle[k - 1]
            if k == 0 or not back:  # line 3
                break
            branch += -1 if decreasing else 1  # line 4
    return angle
