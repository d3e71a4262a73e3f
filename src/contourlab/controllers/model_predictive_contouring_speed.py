"""How fast the axes may be, for what comes on the path: corners, turns, the end.

A horizon sees a turn only when it is near, and a path that is linearised has no corners at all.
With a deceleration a that every axis can give, and Θ(s) the angle that the path has turned by, its
joints' jumps included,

    v²(s) <= a ℓ / (Θ(s + ℓ/2) - Θ(s - ℓ/2)),   v² <= a / κ,   |v²(s) - v²(r)| <= 2 a |s - r|. (1)

ℓ, the *turn-in length*, is over how much of the path a corner may be turned: the change of velocity
v Θ then takes the time ℓ / v. It is the way of one sample at the speed limit, or what the bound on
the contour error allows, 8 ε / Θ for a right angle, if that is less. Neither depends on how long
the path is; a notch of any length counts with all its corners.

(1) holds at the joints of the path and between them, piece by piece: its bounds by curvature there,
and at joints what is left by the slope from all others, backwards and forwards. A formula curve has
no joints; 2048 stretches of equal length stand for pieces, and what a stretch turns beyond its
curvature is a joint's.

With every turn (and the end of an open path) it is how fast a plan may be where it ends; with what
a linearised plan does not see alone, corners and pieces shorter than ℓ, how fast it may be
anywhere.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from contourlab.configuration import replace
from contourlab.contours.path import Path
from contourlab.controllers.model_predictive_contouring_path import ProgressPath
from contourlab.typing import Array, Count, Scalar

__all__ = ["SafeSpeed", "safe_speed"]

STRETCHES = 2048
"""Of a formula curve."""
INSIDE = 8
"""Places at which the curvature of a Bézier piece is looked at."""
SMOOTH = 1e-4
"""Angle [rad] below which a joint is smooth."""
RIGHT_ANGLE = 0.5 * 3.141592653589793


class _Bound(NamedTuple):
    """Squares of speed [m²/s²], infinite where there is no bound."""

    nodes: Array
    """At the ends of pieces, (n_pieces + 1,)."""
    pieces: Array
    """Within pieces, (n_pieces,)."""


class SafeSpeed(eqx.Module):
    """Square of the speed that is safe, over arc length; infinite where there is no bound."""

    breaks: Array
    """Arc lengths of the ends of pieces, from 0, (n_pieces + 1,) [m]."""
    everything: _Bound
    """For every turn and the end."""
    corners: _Bound
    """For what a linearised plan does not see."""
    rise: Array
    """2 a: of the square over the way [m/s²]."""
    closed: bool = eqx.field(static=True)
    equal: bool = eqx.field(static=True)
    """Whether pieces are stretches of equal length."""

    def at(self, bound: _Bound, progress: Scalar, piece: Count) -> tuple[Array, Array]:
        """Return the square of a safe speed [m²/s²] and its slope [m/s²].

        Parameters
        ----------
        bound
            ``everything`` or ``corners``.
        progress
            Arc length [m].
        piece
            Of the contour; not looked at where pieces are equal stretches.
        """
        breaks, n = jnp.asarray(self.breaks), len(self.breaks) - 1
        length = breaks[-1]
        s = jnp.mod(progress, length) if self.closed else jnp.clip(progress, 0.0, length)
        if self.equal:
            share = jax.lax.stop_gradient(s) / length * n
            piece = jnp.clip(jnp.floor(share), 0, n - 1).astype(jnp.int32)
        rise = jnp.asarray(self.rise)
        low = bound.nodes[piece] + rise * (s - breaks[piece])
        high = bound.nodes[piece + 1] + rise * (breaks[piece + 1] - s)
        flat = bound.pieces[piece]
        square = jnp.minimum(jnp.minimum(low, high), flat)
        slope = jnp.where(square == flat, 0.0, jnp.where(low < high, rise, -rise))
        return square, jnp.where(jnp.isfinite(square), slope, 0.0)


class _Turns(NamedTuple):
    """What there is to turn."""

    breaks: Array
    joints: Array
    """Of the angle, at the ends of pieces, (n + 1,); at the ends of an open path 0."""
    pieces: Array
    """Angle turned within, (n,)."""
    curvature: Array
    """Greatest within, (n,)."""


def turn_in_length(speed: Scalar, sample_time: Scalar, contour_error: Scalar | None) -> Array:
    """Return ℓ of the module [m].

    Parameters
    ----------
    speed
        The speed limit [m/s].
    sample_time
        [s].
    contour_error
        Its bound [m]; None if there is none.
    """
    way = jnp.asarray(speed * sample_time)
    # an arc of length ℓ in place of a corner of angle Θ misses it by about ℓ Θ / 8
    return way if contour_error is None else jnp.minimum(way, 8.0 * contour_error / RIGHT_ANGLE)


def safe_speed(path: ProgressPath, deceleration: Scalar, turn_in: Scalar) -> SafeSpeed:
    """Return the safe speed along a path, by (1).

    Parameters
    ----------
    path
        The contour over arc length.
    deceleration
        a > 0 [m/s²]; infinite if commands have no limit, and every speed is then safe.
    turn_in
        ℓ > 0 [m].
    """
    found: SafeSpeed = _safe_speed(path, jnp.asarray(deceleration), jnp.asarray(turn_in))
    return found


@jax.jit
def _safe_speed(path: ProgressPath, deceleration: Array, turn_in: Array) -> SafeSpeed:
    closed = bool(path.contour.closed)
    turns = _path_turns(path.contour) if isinstance(path.contour, Path) else _curve_turns(path)
    bounded = jnp.isfinite(deceleration)
    a = jnp.where(bounded, deceleration, 1.0)
    lengths = jnp.diff(turns.breaks)
    # a plan's samples may step over a short piece; stretches of a formula curve are not pieces,
    # and what turns by more than 1 within ℓ is a corner there
    smooth = not isinstance(path.contour, Path)
    short = turns.curvature * turn_in > 1.0 if smooth else lengths < turn_in
    corners = turns._replace(
        pieces=jnp.where(short, turns.pieces, 0.0), curvature=jnp.zeros_like(turns.curvature)
    )

    def bound(turns: _Turns, *, stop: bool) -> _Bound:
        turned = _turned_around(turns, turn_in, closed)
        bent = turned > SMOOTH
        # not divided by what is next to 0: a derivative backwards would be 0 times infinity
        nodes = jnp.where(bent, a * turn_in / jnp.where(bent, turned, 1.0), jnp.inf)
        straight = turns.curvature * turn_in < 1e-9
        within = jnp.where(straight, jnp.inf, a / jnp.where(straight, 1.0, turns.curvature))
        # a piece may be entered as fast as its curvature allows, and left so
        nodes = nodes.at[:-1].min(within).at[1:].min(within)
        nodes = nodes.at[-1].set(0.0) if stop else nodes
        nodes = jnp.asarray(_spread(nodes, 2.0 * a * lengths, closed))
        return _Bound(jnp.where(bounded, nodes, jnp.inf), jnp.where(bounded, within, jnp.inf))

    everything = bound(turns, stop=not closed)
    unseen = bound(corners, stop=False)
    unseen = unseen._replace(pieces=jnp.full_like(unseen.pieces, jnp.inf))
    return SafeSpeed(turns.breaks, everything, unseen, 2.0 * a, closed, smooth)


def _path_turns(path: Path) -> _Turns:
    closed = path.closed
    path = replace(path, is_closed=False)  # whose end would be wrapped to its start
    breaks = jnp.asarray(path.breaks)
    lengths = jnp.diff(breaks)
    share = jnp.linspace(0.0, 1.0, INSIDE + 1)

    def piece(k: Any) -> tuple[Array, Array, Array]:
        first = breaks[k]

        def look(x: Any) -> tuple[Array, Array]:
            d = path.derivatives(first + x * lengths[k], 2, k)
            return d[1], jnp.sqrt(jnp.sum(d[2] ** 2) + 1e-300)

        tangent, curvature = jax.vmap(look)(share)
        # of a helical piece it is the same everywhere; of a Bézier piece, by its mean
        turned = lengths[k] * jnp.mean(0.5 * (curvature[1:] + curvature[:-1]))
        return jnp.stack([tangent[0], tangent[-1]]), turned, jnp.max(curvature)

    n = path.n_pieces
    ends, turned, curvature = jax.vmap(piece)(jnp.arange(n, dtype=jnp.int32))
    seam = _angle(ends[-1, 1], ends[0, 0]) if closed else jnp.zeros(())
    joints = jnp.concatenate([seam[None], _angle(ends[:-1, 1], ends[1:, 0]), seam[None]])
    return _Turns(breaks - breaks[0], joints, turned, curvature)


def _curve_turns(path: ProgressPath) -> _Turns:
    width = path.length / STRETCHES
    breaks = jnp.arange(STRETCHES + 1) * width
    points = path.points(breaks, jnp.zeros((), jnp.int32))
    angle = _angle(points.tangent[:-1], points.tangent[1:])
    curvature = jnp.sqrt(jnp.sum(points.bend**2, axis=1) + 1e-300)
    greatest = jnp.maximum(curvature[1:], curvature[:-1])
    kink = angle - 1.5 * width * greatest  # 1.5: curvature may vary over a stretch
    kink = jnp.where(kink > 10.0 * SMOOTH, kink, 0.0)
    before = jnp.concatenate([kink, jnp.zeros(1)])
    return _Turns(breaks, before, angle - kink, greatest)


def _angle(before: Array, after: Array) -> Array:
    """Return the size of the change of direction, 0 to 2: what a velocity changes by."""
    return jnp.sqrt(jnp.sum((after - before) ** 2, axis=-1) + 1e-24)


def _turned_around(turns: _Turns, turn_in: Scalar, closed: bool) -> Array:
    """Return what is turned within ℓ/2 of each end of a piece, joints at both ends included."""
    lengths = jnp.diff(turns.breaks)
    joints = jnp.asarray(turns.joints).at[-1].set(0.0)  # of a closed path the first again
    after = jnp.cumsum(joints[:-1] + turns.pieces) - turns.pieces  # Θ after the joint
    total = after[-1] + turns.pieces[-1]
    rate = turns.pieces / lengths
    length = turns.breaks[-1]

    def turned(s: Array, side: str) -> Array:
        """Return Θ at arc lengths, before or after a jump there."""
        rounds = jnp.floor(s / length) if closed else 0.0
        s = s - rounds * length if closed else jnp.clip(s, 0.0, length)
        k = jnp.clip(jnp.searchsorted(turns.breaks, s, side=side) - 1, 0, len(lengths) - 1)
        start = after[k] - (joints[k] * (s <= turns.breaks[k]) if side == "left" else 0.0)
        return start + rate[k] * (s - turns.breaks[k]) + rounds * total

    half = 0.5 * turn_in
    return turned(turns.breaks + half, "right") - turned(turns.breaks - half, "left")


def _spread(nodes: Array, rises: Array, closed: bool) -> Array:
    """Return the most that the slope from all other nodes leaves, backwards and forwards."""

    def limit(square: Any, here: Any) -> tuple[Any, Any]:
        cap, rise = here
        square = jnp.minimum(cap, square + rise)
        return square, square

    for _ in range(2 if closed else 1):  # twice around: what is after the seam counts before
        first = jnp.minimum(nodes[-1], nodes[0]) if closed else nodes[-1]
        first, rest = jax.lax.scan(limit, first, (nodes[:-1], rises), reverse=True)
        nodes = jnp.append(rest, jnp.minimum(nodes[-1], first) if closed else nodes[-1])
    for _ in range(2 if closed else 1):
        first = jnp.minimum(nodes[-1], nodes[0]) if closed else nodes[0]
        first, rest = jax.lax.scan(limit, first, (nodes[1:], rises))
        nodes = jnp.concatenate(
            [(jnp.minimum(nodes[0], first) if closed else nodes[0])[None], rest]
        )
    return nodes
