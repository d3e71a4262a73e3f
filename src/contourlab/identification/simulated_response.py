"""The response of an axis to a recorded command, and its derivatives by the parameters.

    M q'' + B q' + S q + A_f s_f - A_b s_b = a(t),    τ a' + a = u(t - δ)               (1)

in units of the command: M is a mass over the input gain, and so on. s_f and s_b are 1 while the
axis moves forwards and backwards, less what a wide smooth sign lacks there. τ = 0 leaves the drive
out: a = u(t - δ). u is held over a sample.

(1) is solved exactly at the samples: the delay cuts each interval in two, over each of which a
matrix exponential is exact. A record is cut into pieces (:mod:`~contourlab.identification.pieces`),
each of which begins anew: the response is linear in the state that it begins with. Derivatives by
the parameters come from differentiating the loop over the samples, forwards (``jax.jacfwd``): the
delay and the masses alike, without a difference quotient.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.machines.exponential import exponential

__all__ = ["MODEL_PARAMETERS", "Response", "respond"]

MODEL_PARAMETERS = (
    "mass", "viscous", "stiffness", "coulomb_forward", "coulomb_backward", "delay", "drive_lag",
)  # fmt: skip
"""Of (1), in the order of θ."""


class Response(NamedTuple):
    """Of all pieces, padded to one length."""

    position: NDArray[Any]
    """Simulated [m], shape (n_pieces, length)."""
    by_parameters: NDArray[Any]
    """Its derivatives, shape (n_pieces, length, 7)."""
    by_start: NDArray[Any]
    """Its derivatives by the state a piece begins with, shape (length, n_states): the same for
    all pieces."""
    start: NDArray[Any]
    """The states they begin with, shape (n_pieces, n_states)."""


def _held(theta: Any, duration: Any, lagged: bool) -> tuple[Any, Any, Any]:
    """Return transition, input of the command and input of the friction over a duration."""
    mass, viscous, stiffness, lag = theta[0], theta[1], theta[2], theta[6]
    zero, one = jnp.zeros_like(mass), jnp.ones_like(mass)
    if lagged:  # states: position, velocity, a; then the two inputs
        rows = [
            [zero, one, zero, zero, zero],
            [-stiffness / mass, -viscous / mass, one / mass, zero, -one / mass],
            [zero, zero, -one / lag, one / lag, zero],
        ]
    else:
        rows = [
            [zero, one, zero, zero],
            [-stiffness / mass, -viscous / mass, one / mass, -one / mass],
        ]
    n = len(rows)
    top = jnp.stack([jnp.stack(row) for row in rows])
    block = jnp.concatenate([top, jnp.zeros((2, n + 2))])
    whole = exponential(block * duration)
    return whole[:n, :n], whole[:n, n], whole[:n, n + 1]


def _over_a_sample(theta: Any, sample_time: Any, whole: Any, lagged: bool) -> Any:
    later = theta[5] - whole * sample_time  # of the interval, until the newer command acts
    first, f_command, f_friction = _held(theta, later, lagged)
    second, s_command, s_friction = _held(theta, sample_time - later, lagged)
    return (
        second @ first, second @ f_command, s_command, second @ f_friction + s_friction,
    )  # fmt: skip


def _simulated(
    theta: Any, start: Any, older: Any, newer: Any, ahead: Any, back: Any, sample_time: Any,
    whole: Any, lagged: bool,
) -> Any:  # fmt: skip
    transition, by_older, by_newer, by_friction = _over_a_sample(theta, sample_time, whole, lagged)
    friction = theta[3] * ahead - theta[4] * back

    def step(state: Any, row: Any) -> Any:
        old, new, dry = row
        after = (
            state @ transition.T + old[:, None] * by_older + new[:, None] * by_newer
            + dry[:, None] * by_friction
        )  # fmt: skip
        return after, state[:, 0]

    rows = (older.T, newer.T, friction.T)
    return jax.lax.scan(step, start, rows)[1].T


@functools.partial(jax.jit, static_argnames=("lagged",))
def _of_start(theta: Any, sample_time: Any, whole: Any, length: Any, lagged: bool) -> Any:
    transition = _over_a_sample(theta, sample_time, whole, lagged)[0]

    def step(row: Any, _: Any) -> Any:
        return row @ transition, row

    first = jnp.zeros(len(transition)).at[0].set(1.0)
    return jax.lax.scan(step, first, length)[1]


_response = functools.partial(jax.jit, static_argnames=("lagged",))(_simulated)
_derivatives = functools.partial(jax.jit, static_argnames=("lagged",))(jax.jacfwd(_simulated))


def respond(
    theta: NDArray[Any], wanted: NDArray[Any], older: NDArray[Any], newer: NDArray[Any],
    ahead: NDArray[Any], back: NDArray[Any], counts: NDArray[Any], sample_time: float,
) -> Response:  # fmt: skip
    """Return the response of the pieces that fits positions best, whatever they begin with.

    Parameters
    ----------
    theta
        θ, in the order of :data:`MODEL_PARAMETERS`; a drive lag of 0 leaves the drive out.
    wanted
        Positions that tell the states which the pieces begin with, shape (n_pieces, length) [m].
    older, newer
        Command that acts in the first part of each interval and in the rest, likewise.
    ahead, back
        s_f and s_b, likewise.
    counts
        Which rows are there, likewise: the others are padding.
    sample_time
        [s].

    Raises
    ------
    numpy.linalg.LinAlgError
        The response grows beyond all bounds, or a piece does not tell the state it begins with.
    """
    theta = np.asarray(theta, float)
    lagged = bool(theta[6] > 0.0)
    whole = float(np.floor(theta[5] / sample_time))
    n, length = wanted.shape
    states = 3 if lagged else 2
    some = int(2 ** np.ceil(np.log2(n)))  # few shapes, so that little is compiled

    def padded(rows: NDArray[Any]) -> NDArray[Any]:
        return np.pad(rows, ((0, some - n), (0, 0)))

    signals = (*map(padded, (older, newer, ahead, back)), sample_time, whole)
    zero = np.zeros((some, states))
    by_start = np.asarray(
        _of_start(theta, sample_time, whole, np.zeros(length), lagged=lagged), float
    )
    forced = np.asarray(_response(theta, zero, *signals, lagged=lagged))[:n]
    start = _best(by_start, wanted - forced, counts)
    position = forced + start @ by_start.T
    by_parameters = np.asarray(_derivatives(theta, padded(start), *signals, lagged=lagged))[:n]
    return Response(position, by_parameters, by_start, start)


def _best(columns: NDArray[Any], wanted: NDArray[Any], counts: NDArray[Any]) -> NDArray[Any]:
    """Return the least squares solution of each piece over the rows that are there."""
    with np.errstate(over="ignore"):
        size = np.linalg.norm(columns, axis=0)
    if not np.isfinite(size).all():
        raise np.linalg.LinAlgError("the response grows beyond all bounds")
    q, r = np.linalg.qr(columns / size * counts[:, :, None])
    inner = np.einsum("nlk,nl->nk", q, wanted * counts)
    return np.linalg.solve(r, inner[:, :, None])[:, :, 0] / size  # type: ignore[no-any-return]
