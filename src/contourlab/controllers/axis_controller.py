"""What a law that controls every axis by itself is, so that another law can add to its command.

A step of such a law falls into two halves: it *proposes* a command, and once it is known what was
really applied it *settles*: integrals that would only push further into a limit are held. A law
that adds its own share, as cross-coupled control does, stands between the two, so that the axis
law's anti-windup sees the whole command.

The anti-windup is conditional integration: an axis does not integrate while its command is beyond
the limit and the error would push it further out. It needs no gain and works with every mix of
gains; an integral that leads back is never held.
"""

from __future__ import annotations

import abc
from typing import Any, ClassVar, Protocol, cast, runtime_checkable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import as_leaf, check_real, part, real
from contourlab.contours.base import Contour
from contourlab.controllers.base import BoundController, Controller
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel
from contourlab.machines.base import per_axis as spread_over_axes
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = ["AxisController", "BoundAxisController", "clip", "held_integral", "per_axis"]


@runtime_checkable
class _Saturable(Protocol):
    saturated: Count


class BoundAxisController(BoundController):
    """An axis law bound to one contour and sample time.

    Its state has a field ``saturated``, an int32: 1 if the last command was beyond a limit.
    """

    command_limit: Float[Array, " ..."] = real(unit="command unit", above=0.0, finite=False)
    """Largest command, per axis; may be infinite."""

    statuses: ClassVar[tuple[str, ...]] = ("normal", "saturated")

    @abc.abstractmethod
    def propose(self, state: Any, sample: Sample) -> tuple[AxisVector, Any]:
        """Return the command that the law wants, before any limit, and what to settle with.

        Parameters
        ----------
        state
            As ``init`` or the last ``settle`` returned it.
        sample
            This instant.
        """

    @abc.abstractmethod
    def settle(self, proposal: Any, wanted: AxisVector, applied: AxisVector) -> Any:
        """Return the new state, now that it is known what was applied.

        Parameters
        ----------
        proposal
            What ``propose`` returned.
        wanted
            The whole command before the limit, with everything that other laws added.
        applied
            The command after the limit.
        """

    def step(self, state: Any, sample: Sample) -> tuple[AxisVector, Any]:
        """Return the command, shape (n_axes,), and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """
        wanted, proposal = self.propose(state, sample)
        applied = clip(wanted, self.command_limit)
        return applied, self.settle(proposal, wanted, applied)

    def status(self, state: _Saturable) -> Count:
        """Return 1 if an axis was at its limit, else 0.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return state.saturated


class AxisController(Controller):
    """A law that controls every axis by itself, on a nominal model."""

    model: NominalModel = part()

    def __check_init__(self) -> None:
        refuse_no_model(self.model)

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return self.model.n_axes

    @abc.abstractmethod
    def bind(self, contour: Contour, sample_time: Scalar) -> BoundAxisController:
        """Return the law for one sample time.

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


def refuse_no_model(model: object) -> None:
    """Raise ConfigurationError unless a law was given a nominal model."""
    if not isinstance(model, NominalModel):
        raise ConfigurationError(
            f"model must be a NominalModel, such as machine.nominal, got {type(model).__name__}"
        )


def refuse_no_axis_law(axis: object, role: str = "") -> None:
    """Raise ConfigurationError unless a law was given an axis law.

    Parameters
    ----------
    axis
        What was given.
    role
        What the axis law is for, as a clause of the sentence.
    """
    if not isinstance(axis, AxisController):
        raise ConfigurationError(
            f"axis must be an axis law, such as AxisPid or Cascade, {role}got {type(axis).__name__}"
        )


def refuse_position_command(name: str, model: NominalModel) -> None:
    """Raise RefusedError if a model is commanded by positions: its drive closes the loop itself."""
    if model.command == "position":
        raise RefusedError(
            f"{name} commands a voltage, a force or a velocity; this model takes a position, "
            "its drive closes the position loop itself"
        )


SHARED_AXES = (
    "laws in the position domain, such as InternalModelContouring, give each axis a place of "
    "its own"
)
"""Where a law that does not say how axes share a coordinate sends its user."""


def refuse_unlike_axes(law: str, n_axes: int, contour: Contour) -> None:
    """Raise RefusedError unless a contour has one coordinate for each axis.

    Parameters
    ----------
    law
        Name of the law, for the message.
    n_axes
        Axes that it commands.
    contour
        What it is to follow.
    """
    if contour.n_axes == n_axes:
        return
    shared = (
        "; how axes would share a correction of the tool point is not defined here: " + SHARED_AXES
        if n_axes > contour.n_axes
        else ""
    )
    raise RefusedError(
        f"{law} needs one axis for each coordinate of the contour: it has {n_axes} axes, the "
        f"contour {contour.n_axes} coordinates{shared}"
    )


def per_axis(name: str, value: Any, n_axes: int) -> Array:
    """Return a value for every axis, shape (n_axes,), where a law is bound.

    The rule is that of :func:`contourlab.machines.base.per_axis`, but for batches: a law is bound
    one at a time, under ``vmap`` if there are many.

    Parameters
    ----------
    name
        Of the field, for the message.
    value
        One number, or one per axis.
    n_axes
        Number of axes.

    Raises
    ------
    ConfigurationError
        Neither.
    """
    if np.shape(value) not in ((), (1,), (n_axes,)):
        raise ConfigurationError(
            f"{name} must be one number or one for each of the {n_axes} axes, "
            f"got shape {np.shape(value)}"
        )
    return spread_over_axes(name, value, n_axes)


def checked_per_axis(name: str, value: Any, n_axes: int, **bounds: float) -> Array:
    """Return a value for every axis, shape (n_axes,), of an argument that no field has checked.

    Parameters
    ----------
    name
        Of the argument, for the message.
    value
        One number, or one per axis.
    n_axes
        Number of axes.
    **bounds
        As :func:`contourlab.configuration.real` takes them.

    Raises
    ------
    ConfigurationError
        Neither, no number, or out of bounds.
    """
    leaf = as_leaf(value)
    check_real(name, leaf, **cast(Any, bounds))
    return per_axis(name, leaf, n_axes)


def clip(command: AxisVector, limit: AxisVector) -> AxisVector:
    """Return a command within ± limit; NaN stays NaN.

    Parameters
    ----------
    command, limit
        Shape (n_axes,).
    """
    return jnp.minimum(jnp.maximum(command, -limit), limit)


def held_integral(
    integral: AxisVector, increment: AxisVector, wanted: AxisVector, applied: AxisVector
) -> AxisVector:
    """Return the integral after one sample, held where it would push further into the limit.

    Parameters
    ----------
    integral
        Before, shape (n_axes,).
    increment
        What the sample adds; must push the command in the direction of its sign.
    wanted, applied
        Command before and after the limit.
    """
    outwards = (wanted - applied) * increment > 0.0
    return integral + jnp.where(outwards, 0.0, increment)
