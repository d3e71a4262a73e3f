"""The second signal of the exosystem, along a path: which, in what size, and its value.

See :mod:`~contourlab.controllers.exosystem` for what it is for. Signals are brought to the size of
the slave's reference, which changes nothing but rounding.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, real
from contourlab.controllers.exosystem import SIGNALS, turning
from contourlab.controllers.path_grid import fine_grid, path_rows
from contourlab.controllers.position_domain import PositionDomain
from contourlab.errors import ConfigurationError
from contourlab.typing import Array, AxisVector, Scalar, Vector

__all__ = ["SecondSignal"]


class SecondSignal(Configuration):
    """g of every slave; made by :meth:`along`."""

    choice: Float[Array, "3 n_slaves"] = real()
    """1 for the signal that is taken, of position, master and derivative; else 0."""
    scale: Float[Array, "3 n_slaves"] = real()
    """Of each."""
    turning: Float[Array, "3 n_slaves"] = real()
    """How well w turns with each, 0 to 1; 0 is singular somewhere."""
    offset: Float[Array, ""] = real(unit="m")
    """Added to the position signal."""

    @staticmethod
    def along(
        domain: PositionDomain,
        slaves: tuple[int, ...],
        name: str,
        offset: Scalar | None,
    ) -> SecondSignal:
        """Return the second signal of a path.

        Parameters
        ----------
        domain
            The path and its master.
        slaves
            The other axes.
        name
            One of :data:`SIGNALS`.
        offset
            Added to the position signal [m]; None for 0.

        Raises
        ------
        ConfigurationError
            An offset, and no slave that takes the position.
        """
        shift = 0.0 if offset is None else offset
        grid = fine_grid(domain.path)
        rows = np.asarray(path_rows(domain.path, grid, 2))
        own, motion = np.asarray(slaves, int), domain.motion
        f, slope, bend = (rows[:, k][:, own] for k in range(3))
        master = rows[:, 0, motion.axis] - motion.centre, rows[:, 1, motion.axis]
        size = np.max(np.abs(f), 0)
        steepest = np.max(np.abs(slope), 0)
        # a slave that stands still, or whose reference is 0, has no size of its own
        size = np.where(size > 0.0, size, motion.amplitude)
        per_slope = size / np.where(steepest > 0.0, steepest, 1.0)
        scale = np.stack([
            np.full(len(own), 1.0), size / np.asarray(motion.amplitude), per_slope
        ])  # fmt: skip
        place, place_slope = (
            (motion.steepest * grid, np.full(len(grid), motion.steepest))
            if motion.rotational
            else (rows[:, 0, motion.axis], rows[:, 1, motion.axis])
        )
        one = np.ones(len(own))
        signals = (
            ((place + shift)[:, None] * one, place_slope[:, None] * one),
            (master[0][:, None] * scale[1], master[1][:, None] * scale[1]),
            (slope * scale[2], bend * scale[2]),
        )
        turns = np.stack([turning(f, slope, g, rate) for g, rate in signals])
        taken = (
            np.argmax(turns, 0)
            if name == SIGNALS[0]
            else np.full(len(own), SIGNALS.index(name) - 1)
        )
        if offset is not None and not np.any(taken == 0):
            raise ConfigurationError(
                "offset is added to the position as second signal, which is the best of none of "
                "the slaves on this path; remove it, or take second_signal 'position'"
            )
        choice = (np.arange(3)[:, None] == taken).astype(float)
        return SecondSignal(choice=choice, scale=scale, turning=turns, offset=np.asarray(shift))

    def value(
        self, domain: PositionDomain, parameter: Scalar, target: AxisVector, slope: AxisVector,
        slaves: tuple[int, ...],
    ) -> Vector:  # fmt: skip
        """Return g of every slave at one place on the path, shape (n_slaves,) [m].

        Parameters
        ----------
        domain
            The path and its master.
        parameter
            Where.
        target, slope
            Positions of all axes there, and their slopes over the parameter.
        slaves
            The other axes.
        """
        motion, own = domain.motion, np.asarray(slaves, int)
        master = target[motion.axis]
        place = motion.steepest * parameter if motion.rotational else master
        one = jnp.ones(len(slaves))
        signals = jnp.stack([
            (place + self.offset) * one, (master - motion.centre) * self.scale[1],
            slope[own] * self.scale[2],
        ])  # fmt: skip
        return jnp.sum(self.choice * signals, 0)
