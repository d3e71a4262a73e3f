"""A reserve of the command for a mass that is more than the model's.

A plan of least time runs along the limit of the command. If the axes weigh more than the model
says, nothing is left there to hold the plan with. So each planned motion is asked for twice: with
the model's mass M and its command u_j, and with the most that the axes may weigh, M (1 + δ).

The observer explains what a wrong mass does by a disturbance: at the acceleration a_f that it has
seen so far a mass M' leaves d' = d + (M' - M) a_f / K of it. With that mass the planned motion, of
acceleration a_j, takes

    u'_j = u_j + (M' - M) (a_j - a_f) / K,                                                    (1)

so that nothing is kept for what the observer has found already, and the more the farther ahead the
plan changes its acceleration. Until it has found it, axes of mass M (1 + δ) fall short of the plan
by the acceleration δ (a_j - a_f) / (1 + δ) over a sample, and to make up for that in the next
takes once more the command δ M (a_j - a_f) / K. Held and made up for, it is (1) with

    M' = M (1 + 2 δ),                                                                        (2)

and |u'_j| <= the command limit is what a plan keeps from stage 1 on. The first command, the one
that is applied, may use all of the limit: there the reserve is for use.

a_f is not formed: an observer with the mass M' beside the model's finds d', and the command of the
planned motion follows from the held axes of mass M', whose velocities are to be the plan's. A
lighter machine needs no rows: (1) is linear in M', its bounds are convex, and with M' = 0 it is
what holds a velocity, which is reached only if the command suffices for it.

That a plan made with one model has to be feasible with others is known as multi-stage or scenario
predictive control, a limit that narrows along the horizon as constraint tightening; (2) is ours.
"""

from __future__ import annotations

import jax.numpy as jnp

from contourlab.controllers.held_model import HeldAxes
from contourlab.typing import Array, AxisVector

__all__ = ["HELD_AND_MADE_UP", "reserve_commands", "reserve_rows"]

HELD_AND_MADE_UP = 2.0
"""Times δ in (2): once to hold the plan, once to make up for what was missed."""


def reserve_commands(
    heavy: HeldAxes, positions: Array, velocities: Array, disturbance: Array
) -> Array:
    """Return u' of a plan, shape (n_stages, n_axes).

    Parameters
    ----------
    heavy
        The held axes of mass M'.
    positions, velocities
        Planned, shape (n_stages + 1, n_axes) each [m, m/s].
    disturbance
        d' less friction, in units of the command, shape (n_stages, n_axes).
    """
    missing = (
        velocities[1:]
        - heavy.velocity_from_velocity * velocities[:-1]
        - heavy.velocity_from_position * positions[:-1]
    )
    return jnp.asarray(missing / heavy.velocity_from_command - disturbance)


def reserve_rows(
    heavy: HeldAxes, following: Array, position: Array, velocity: Array, limit: AxisVector
) -> Array:
    """Return the rows of u' over the command limit, one for each axis.

    Parameters
    ----------
    heavy
        The held axes of mass M'.
    following, position, velocity
        Rows that give the velocities of the next stage, and positions and velocities of this one,
        in SI, shape (n_axes, width) each.
    limit
        Of the command; infinite where there is none.
    """
    rows = (
        following
        - heavy.velocity_from_velocity[:, None] * velocity
        - heavy.velocity_from_position[:, None] * position
    )
    return jnp.asarray(rows / (heavy.velocity_from_command * limit)[:, None])
