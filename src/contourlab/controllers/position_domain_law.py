"""What laws in the position domain share: one master axis, the others sent where the master is.

An axis law (``axis``) runs the master in time, as it would run it alone, and the slaves until they
are engaged. The law's own share is what the slaves do.

**Redundant axes.** A path of more axes than the tool has coordinates is taken in the space of the
axes (:func:`contourlab.contours.combined`): every axis has a place for every parameter, so that
nothing has to be shared out.

**The master.** Its amplitude and phase are compensated where that can be done
(:mod:`~contourlab.controllers.master_compensation`); the recording says which axis it is, and where
nothing is compensated.

References
----------
.. [CaoZhang] section 2.2, Remark 2.1.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from contourlab.contours.base import Contour
from contourlab.contours.combined import CombinedAxes
from contourlab.controllers.axis_controller import AxisController, refuse_no_axis_law
from contourlab.controllers.master import choose_master, master_motion
from contourlab.controllers.position_domain import PositionDomain
from contourlab.controllers.smooth_path import refuse_corners
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.typing import Scalar

__all__ = ["TURNING_WIDTH", "bound_domain", "check_conversion", "master_fact", "refuse_lone_axis"]

TURNING_WIDTH = 0.03
"""ε of the position domain, unless another is given."""


def refuse_lone_axis(axis: Any) -> None:
    """Raise an error unless a law was given an axis law for two axes or more.

    Parameters
    ----------
    axis
        What was given.
    """
    refuse_no_axis_law(axis, "which runs the master, ")
    if axis.n_axes < 2:
        raise RefusedError("axis must be for 2 axes or more: a master and its slaves, got 1")


def bound_domain(
    law: str, contour: Contour, axis: AxisController, master: int | None, conversion: str,
    turning_width: Scalar | None,
) -> PositionDomain:  # fmt: skip
    """Return the position domain of a path, with the master that was asked for or chosen.

    Parameters
    ----------
    law
        Name of the law, for messages.
    contour
        The tool's path.
    axis
        The axis law.
    master
        Which axis, or None for the one recommended.
    conversion, turning_width
        Of the position domain.

    Raises
    ------
    RefusedError
        The path has another number of axes or a corner, or no master; says which axis fails where.
    ConfigurationError
        No such axis.
    """
    n = axis.n_axes
    path = contour.axes if isinstance(contour, CombinedAxes) else contour
    if path.n_axes != n:
        raise RefusedError(
            f"{law} sends every axis to its own place on the path: it commands {n} axes, the path "
            f"has {path.n_axes} coordinates; a path of redundant axes is given in axes, by "
            "contours.combined(path_of_axes, tool_matrix)"
        )
    refuse_corners(law, path)
    names = tuple(f"axis {k}" for k in range(n))
    if master is None:
        master = choose_master(law, path, axis.model, names)
    if not master < n:
        raise ConfigurationError(f"master must be one of the {n} axes, 0 to {n - 1}, got {master}")
    motion = master_motion(law, path, master, names)
    if conversion == "arccos" and not motion.cosine:
        kind = "it only rises or only falls" if not motion.rotational else "which it is not"
        raise RefusedError(
            f"{law} with conversion 'arccos' needs a master that swings as a cosine of the contour "
            f"parameter, y = c + R cos(κ p + phase); axis {master} on this path: {kind}; take "
            "conversion 'tracked'"
        )
    width = TURNING_WIDTH if turning_width is None else turning_width
    return PositionDomain(
        path=path, motion=motion, turning_width=np.asarray(width), conversion=conversion
    )


def check_conversion(conversion: str, turning_width: Scalar | None) -> None:
    """Raise ConfigurationError if a turning width is given where it would change nothing.

    Parameters
    ----------
    conversion, turning_width
        Of a law.
    """
    if conversion == "arccos" and turning_width is not None:
        raise ConfigurationError(
            "turning_width goes with conversion 'tracked'; 'arccos' takes the angle as it comes"
        )


def master_fact(domain: PositionDomain, *, asked: bool) -> str:
    """Return which axis is the master and why, for the recording.

    Parameters
    ----------
    domain
        As bound.
    asked
        Whether the law was told which axis to take.
    """
    motion = domain.motion
    why = "as asked" if asked else "the slowest of the axes that can be, by the model"
    return f"axis {motion.axis}, {why}; {'rotational' if motion.rotational else 'monotone'}"
