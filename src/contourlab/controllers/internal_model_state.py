"""What internal-model contouring remembers from sample to sample.

Coefficients of the exosystem at an instant take samples from before and after it: what needs α2 of
an instant waits in the state for the next one. So "last" is one sample before the step that reads.

References
----------
.. [CaoZhang] the states of (42).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from contourlab.controllers.immersion import InternalUnit
from contourlab.controllers.position_domain import PositionDomainState
from contourlab.controllers.pulse_model import ObserverState
from contourlab.typing import Array, Count, Vector

__all__ = ["InternalModelState"]


class InternalModelState(NamedTuple):
    """What the law remembers; vectors have one value per slave, "last" is one sample before."""

    axis: Any
    """State of the axis law."""
    domain: PositionDomainState
    """Where the master was predicted to be at this instant."""
    master: ObserverState
    """Of the master, predicted for this instant."""
    disturbed: ObserverState
    """Of the slaves, likewise."""
    reference: Array
    """f at the last instant and at this one, shape (2, n_slaves) [m]."""
    second: Array
    """g at the last instant and at this one [m]."""
    alpha: Vector
    """α1 at the last instant."""
    copy: Array
    """ξ1, the axes' copy, at the last instant, shape (n_slaves, n) [m]."""
    unit: InternalUnit
    """η, at the last instant."""
    observed: Array
    """ẑ at the last instant, shape (n_slaves, n - 1)."""
    error: Vector
    """e at the last instant [m]."""
    applied: Vector
    """Command that drove the copy since then."""
    by_model: Vector
    """u_im of the last instant."""
    by_gain: Vector
    """u_st as applied since then."""
    last_step: Array
    """α1 at the last step, its error e [m], and whether there was a recurrence: (3, n_slaves)."""
    samples: Count
    """Samples so far, int32."""
    status: Count
    """Index into ``statuses``, int32."""
