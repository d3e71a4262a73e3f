"""What a control law is: a configuration, and what it becomes when it is bound to a contour.

A law is written as two frozen values. The *configuration* (a :class:`Controller`) holds gains and a
nominal model, says what it ``needs``, and knows no contour and no sample time. ``bind`` gives the
*bound law* (a :class:`BoundController`), which holds what was discretised or prepared and has the
loop's functions. Neither changes; all that evolves is in the state.
"""

from __future__ import annotations

import abc
import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from contourlab.configuration import Configuration
from contourlab.contours.base import Contour
from contourlab.errors import RefusedError
from contourlab.machines.base import COMMAND_KINDS, CommandKind, ToolMap
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Flag, Scalar

__all__ = ["BoundController", "Controller", "Needs", "in_tool_space"]


class Needs(eqx.Module):
    """What a law asks of the loop; all static."""

    command: CommandKind = eqx.field(static=True, kw_only=True)
    """Kind of command that the law gives: voltage, force, velocity or position."""
    preview: int = eqx.field(static=True, default=0, kw_only=True)
    """Number of reference points ahead."""
    derivatives: int = eqx.field(static=True, default=-1, kw_only=True)
    """Order of the contour derivatives in ``Sample.geometry``; -1 for none."""
    contour: bool = eqx.field(static=True, default=False, kw_only=True)
    """Whether it evaluates the contour itself."""
    own_time: bool = eqx.field(static=True, default=False, kw_only=True)
    """Whether the law plans its own time: of the reference it takes the start, it says when it has
    ``finished``, and reports its place on the contour as ``path_parameter`` in its telemetry."""
    host_synthesis: bool = eqx.field(static=True, default=False, kw_only=True)
    """Whether ``bind`` does work that cannot be traced, such as solving an LMI."""
    tool_map: bool = eqx.field(static=True, default=False, kw_only=True)
    """Whether the law takes account of the machine's tool map. One that looks at the contour and
    does not takes axis positions for those of the tool, and is refused where they differ; one that
    asks nothing of the contour follows its axes, whatever the tool makes of them."""
    axes_path: bool = eqx.field(static=True, default=False, kw_only=True)
    """Whether the law takes the path in the space of the axes. On a machine with a tool map the
    contour must then be one of ``contours.combined``, made with that map."""

    def __check_init__(self) -> None:
        if self.command not in COMMAND_KINDS:
            raise RefusedError(
                f"command must be one of {', '.join(COMMAND_KINDS)}, got {self.command!r}"
            )
        if self.preview < 0 or self.derivatives < -1:
            raise RefusedError("preview must be >= 0 and derivatives >= -1")


class BoundController(Configuration):
    """A control law bound to one contour and sample time: pure functions of state and sample."""

    statuses: ClassVar[tuple[str, ...]] = ("normal",)
    """What each status number means; 0 is normal."""
    state_units: ClassVar[dict[str, str]] = {}
    """Units in exported code of what the state's own class does not tell right, by path."""

    @abc.abstractmethod
    def init(self, sample: Sample) -> Any:
        """Return the state before the first step: a pytree of float64 and int32 arrays.

        Parameters
        ----------
        sample
            The first sample; ``step`` is then called with this same sample.
        """

    @abc.abstractmethod
    def step(self, state: Any, sample: Sample) -> tuple[AxisVector, Any]:
        """Return the command, shape (n_axes,), and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """

    def telemetry(self, state: Any) -> dict[str, Array]:
        """Return what is worth recording, by name, from the new state.

        A law that estimates the contour error reports it as ``contour_error_estimate``, the vector
        in tool space.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        del state
        return {}

    def facts(self) -> dict[str, str]:
        """Return what was chosen or found when the law was bound, by name, in words.

        It goes into the recording's attributes, from where reports take it; names are words joined
        by underscores.
        """
        return {}

    def warnings(self) -> tuple[str, ...]:
        """Return what could not be done when the law was bound, in sentences, for the recording."""
        return ()

    def status(self, state: Any) -> Count:
        """Return the status of the last step, an index into ``statuses``.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        del state
        return jnp.zeros((), jnp.int32)

    def finished(self, state: Any) -> Flag:
        """Return whether a law that plans its own time has arrived; others never say so.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        del state
        return jnp.zeros((), bool)


class Controller(Configuration):
    """Configuration of a control law, with a nominal model of the machine, never the machine."""

    @property
    @abc.abstractmethod
    def needs(self) -> Needs:
        """What the law asks of the loop."""

    @property
    @abc.abstractmethod
    def n_axes(self) -> int:
        """Number of axes that the law commands."""

    @abc.abstractmethod
    def bind(self, contour: Contour, sample_time: Scalar) -> BoundController:
        """Return the law for one contour and sample time; runs once, before the loop.

        Parameters
        ----------
        contour
            The path that the loop follows.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            The law cannot take this contour; says why.
        """


def in_tool_space(sample: Sample, tool: ToolMap) -> Sample:
    """Return a sample whose measured position and velocity are those of the tool, for an estimator.

    The reference stays in axes: an estimator takes the contour from ``geometry``, which is in tool
    space, and the speed along it from the reference's parameter rate.

    Parameters
    ----------
    sample
        One instant, in axes.
    tool
        Of the machine, as the law believes it.
    """
    position, velocity = jax.jvp(tool.tool_from_axes, (sample.position,), (sample.velocity,))
    return dataclasses.replace(sample, position=position, velocity=velocity)
