"""The nearest point of one row's stretch, and whether the stretch leaves its ball in the row.

Lines and planar arcs have closed forms. A Bézier row is first tried whole: let e be the distance of
the point q from the reference point c, and K bound the curvature of the row. If 3.2 e K < 1, then
inside the ball of radius 2 e about c

- |r - q| <= 3 e, so that |r - q|² is convex over arc length: the stretch has one minimum;
- |r - c|² is convex too: the row leaves the ball once, at most 4.4 e of arc length from where the
  stretch begins (the chord is at most 4 e, and 2 asin(2 e K) / K < 4.4 e);
- on those 4.4 e the row turns by less than a right angle, so what lies there in the ball lies in
  the stretch.

So a minimum with |r - q| <= e at most 4.4 e away is the one looked for, and the end of the row is
on the stretch if it is as near as that and in the ball. K is certain
(:class:`~contourlab.contours.foot_points.path_table.BezierTable`). What is not certain by this goes
the way of :mod:`~contourlab.contours.foot_points.certified`, as do helices.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.foot_points.certified import dot, first_exit, nearest
from contourlab.contours.foot_points.path_table import ARC, BEZIER, LINE, PathTable

__all__ = ["AHEAD", "BEHIND", "BOTH", "Balls", "RowFeet", "row_feet"]

AHEAD, BEHIND, BOTH = 1, -1, 0

_CONVEX, _REACH = 3.2, 4.4
_STEPS = 8

Values = NDArray[Any]


class Balls(NamedTuple):
    """Points, and the balls of twice their error about their reference points, one per column."""

    q: Values
    centre: Values
    error2: Values

    def of(self, some: Any) -> Balls:
        """Return some of them."""
        return Balls(self.q[:, some], self.centre[:, some], self.error2[some])


class RowFeet(NamedTuple):
    """What is found in rows."""

    s: Values
    squared: Values
    out_ahead: Values
    """Whether the stretch ends in the row, or its end is known to be out of the ball."""
    out_behind: Values


def row_feet(
    table: PathTable, balls: Balls, row: Values, begin: Values, way: int, known: Values
) -> RowFeet:
    """Return the feet on the stretches of rows that begin at a place and go on one way or both.

    Parameters
    ----------
    table
        The path.
    balls
        One per lane.
    row, begin
        Where the stretch begins in the row, inside the ball.
    way
        ``AHEAD``, ``BEHIND`` or ``BOTH``.
    known
        Squared distance known already; what is not nearer need not be found.
    """
    n = len(row)
    feet = RowFeet(begin.copy(), np.full(n, np.inf), np.zeros(n, bool), np.zeros(n, bool))
    for kind, some in table.groups(row):
        given = balls.of(some), row[some], begin[some]
        if kind == LINE:
            new = _on_lines(table, *given, way)
        elif kind == ARC:
            new = _on_arcs(table, *given, way)
        else:
            new = _on_curves(table, *given, way, known[some], kind)
        for whole, part in zip(feet, new, strict=True):
            whole[some] = part
    return feet


def _on_lines(table: PathTable, balls: Balls, row: Values, begin: Values, way: int) -> RowFeet:
    del begin, way
    tangent = table.tangent[:, row]
    away = balls.q - table.origin[:, row]
    s = np.clip(dot(away, tangent), 0.0, table.length[row])
    away -= tangent * s
    never = np.zeros(len(row), bool)
    return RowFeet(s, dot(away, away), never, never)


def _on_arcs(table: PathTable, balls: Balls, row: Values, begin: Values, way: int) -> RowFeet:
    rate, length = table.rate[row], table.length[row]
    half = np.pi / np.abs(rate)
    # the distance from the centre of the ball peaks opposite its foot on the circle
    x, y, across = table.in_arc_plane(row, balls.centre)
    far = np.arctan2(x, y) / rate + half
    peak = ((np.sqrt(x * x + y * y) + 1.0) / rate) ** 2 + across > 4.0 * balls.error2 * (1 + 1e-12)
    top, bottom = length.copy(), np.zeros(len(row))
    over = [np.zeros(len(row), bool), np.zeros(len(row), bool)]
    for k, sign in enumerate((AHEAD, BEHIND)):
        if way not in (sign, BOTH):
            (top if sign == AHEAD else bottom)[:] = begin
            continue
        ahead = np.mod(sign * (far - begin), 2.0 * half)
        ahead = np.where(ahead < 1e-9 * half, ahead + 2.0 * half, ahead)
        room = length - begin if sign == AHEAD else begin
        over[k] = peak & (ahead < room)
        if sign == AHEAD:
            top = np.where(over[k], begin + ahead, top)
        else:
            bottom = np.where(over[k], begin - ahead, bottom)
    s = table.arc_foot(row, balls.q, bottom, top)
    d = table.look_kind(ARC, row, s, balls.q, 0)[0]
    return RowFeet(s, dot(d, d), *over)


def _on_curves(
    table: PathTable,
    balls: Balls,
    row: Values,
    begin: Values,
    way: int,
    known: Values,
    kind: int,
) -> RowFeet:
    n = len(row)
    feet = RowFeet(begin.copy(), np.full(n, np.inf), np.zeros(n, bool), np.zeros(n, bool))
    rest = np.arange(n)
    if kind == BEZIER:
        rest = _whole(table, balls, row, begin, feet)
    if not len(rest):
        return feet
    given, at, place = balls.of(rest), row[rest], begin[rest]
    ends, reach = [place, place], 4.0 * given.error2
    for k, sign in enumerate((AHEAD, BEHIND)):
        if way in (sign, BOTH):
            edge = table.extent[at] if sign == AHEAD else np.zeros(len(at))
            ends[k], feet[2 + k][rest] = first_exit(table, given.centre, reach, at, place, edge)
    s, squared = nearest(table, given.q, at, ends[1], ends[0], known[rest])
    feet.s[rest], feet.squared[rest] = s, squared
    return feet


def _whole(table: PathTable, balls: Balls, row: Values, begin: Values, feet: RowFeet) -> Values:
    """Find feet on Bézier rows by Newton's method; return for which it is not certain."""
    bezier = table.bezier
    assert bezier is not None
    own, error = table.bezier_row[row], np.sqrt(balls.error2)
    hopeful = np.flatnonzero(_CONVEX * error * bezier.curvature[own] < 1.0)
    going, at, e = hopeful, own[hopeful], error[hopeful]
    powers, u = bezier.powers[:, :, at], begin[hopeful]
    away = table.origin[:, row[hopeful]] - balls.q[:, hopeful]
    done = np.zeros(len(row), bool)
    for _ in range(_STEPS):
        if not len(going):
            break
        d, slope, bend = bezier.look(powers, u)
        d += away
        speed2, along = dot(slope, slope), dot(d, slope)
        # 1 + d . r'' over arc length: the second derivative of half the squared distance
        convex = 1.0 + (dot(d, bend) - along * dot(slope, bend) / speed2) / speed2
        new = np.clip(u - along / (speed2 * np.maximum(convex, 0.02)), 0.0, 1.0)
        speed = np.sqrt(speed2)
        # Newton's method ends quadratically: behind so small a step is the foot to rounding
        small = np.abs(new - u) * speed <= 1e-8 * e + 0.1 * table.rounding
        small &= convex > 0.02
        ended = np.flatnonzero(small)
        lanes, step = going[ended], (new - u)[ended]
        d = d[:, ended] + step * (slope[:, ended] + 0.5 * step * bend[:, ended])
        feet.s[lanes], feet.squared[lanes] = new[ended], dot(d, d)
        done[lanes] = True
        more = np.flatnonzero(~small)
        if len(more) < len(going):
            going, e, powers = going[more], e[more], powers[:, :, more]
            away = away[:, more]
        u = new[more]
    s = _lengths(table, row, begin, done)
    lanes = np.flatnonzero(done)
    most = _REACH * error[lanes] + table.rounding
    fastest = bezier.rates[0][own[lanes]]
    u, length = feet.s[lanes], table.length[row[lanes]]
    off = table.look_kind(BEZIER, row[lanes], u, balls.centre[:, lanes], 0)[0]
    reach = 2.0 * error[lanes] + table.rounding
    sure = np.abs(u - begin[lanes]) * fastest <= most
    sure &= (dot(off, off) <= reach * reach) | (u == begin[lanes])
    # the first guess is not moved where the best is not nearer than the reference point
    feet.out_ahead[lanes] = length - s > most
    feet.out_behind[lanes] = s > most
    left = np.ones(len(row), bool)
    left[lanes[sure]] = False
    rest = np.flatnonzero(left)
    feet.s[rest], feet.squared[rest] = begin[rest], np.inf
    feet.out_ahead[rest] = feet.out_behind[rest] = False
    return rest


def _lengths(table: PathTable, row: Values, begin: Values, some: Values) -> Values:
    """Return arc lengths from the starts of Bézier rows to places, to the accuracy of guesses."""
    bezier = table.bezier
    assert bezier is not None
    at, u = row[some], begin[some]
    own = table.bezier_row[at]
    slope = bezier.look(bezier.powers[:, :, own], u, 1)[1]
    return bezier.length_to(own, table.length[at], u, np.sqrt(dot(slope, slope)))
