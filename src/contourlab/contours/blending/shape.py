"""The shape of a blend: where the control points of its quintic stand, chosen by turning angle.

A blend of two lines trimmed by L is a quintic with its control points on the two lines, at
distances L, a₁L, a₂L from the corner, mirrored on the other side: G2, as six points on two lines
have no curvature at the ends. With the turning angle θ its middle is

    e = L (1 + 5 a₁ + 10 a₂) / 16 · sin(θ/2)

from the corner, and that is its deviation, both ways. a₁ and a₂ are free.

How they were chosen. At equal e, a machine goes round with the speed v_A = √(A/κ) that its
acceleration A allows, or with v_J = ∛(J/√(κ'² + κ⁴)) that its jerk J allows, at the worst place;
with everyday numbers (5 m/s², 500 m/s³, 20 µm) the two are about equal. Numerical search over the
handles gave, at 90°, with A = J = e = 1:

====================================  =====  =====  ===
family                                v_A    v_J    L/e
====================================  =====  =====  ===
quintic, least curvature              1.55   0.53   2.5
quintic, most v_J (taken)             1.43   1.61   3.2
degree 7, G2, most v_J                1.43   1.61   3.3
degree 9, G2, most v_J                1.43   1.61   3.2
====================================  =====  =====  ===

From 10° to 160° higher degrees gain less than 1 %, although the search left them free to be G3:
they pay for smoother ends in the middle. So the quintic stays, with the handles of most v_J (a
tenth of the weight on v_A, which costs nothing). They also are near the best at equal trim, for
short pieces. Below 6° a₁ = 3/5, a₂ = 1/5 is taken instead, which gives up a ninth of v_J there:
this quintic runs at nearly constant |dr/du|, so that its arc length is one short series and a
relief of 100 000 short lines stays one row a corner instead of four.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["deviation_per_trim", "handle_ratios", "quintic"]

Rows = NDArray[Any]

_ANGLE = np.radians([0, 6, 25, 35, 45, 60, 75, 90, 105, 120, 135, 150, 160, 170, 175, 179, 180])
_FIRST = np.array([
    0.6, 0.6, 0.5937, 0.5912, 0.5896, 0.5904, 0.5976, 0.6114, 0.6314, 0.6734, 0.7341, 0.8032,
    0.8599, 0.9250, 0.9611, 0.9920, 1.0,
])  # fmt: skip
_SECOND = np.array([
    0.2, 0.2, 0.1597, 0.1710, 0.1857, 0.2140, 0.2503, 0.2960, 0.3593, 0.4327, 0.5235, 0.6398,
    0.7346, 0.8510, 0.9207, 0.9833, 1.0,
])  # fmt: skip


def handle_ratios(angle: Rows) -> tuple[Rows, Rows]:
    """Return a₁ and a₂ of the module's text for turning angles.

    Parameters
    ----------
    angle
        Turning angles, 0 to π [rad].
    """
    return np.interp(angle, _ANGLE, _FIRST), np.interp(angle, _ANGLE, _SECOND)


def deviation_per_trim(angle: Rows) -> Rows:
    """Return e/L of a blend of two lines.

    Parameters
    ----------
    angle
        Turning angles, 0 to π [rad].
    """
    first, second = handle_ratios(angle)
    return (1.0 + 5.0 * first + 10.0 * second) / 16.0 * np.sin(0.5 * angle)


def quintic(
    start: tuple[Rows, Rows, Rows], end: tuple[Rows, Rows, Rows], trim: Rows, angle: Rows
) -> Rows:
    """Return Bézier points of quintics with given point, tangent and curvature vector at both ends.

    With r'(0) = 5 h T and r''(0) = 25 h² K + 20 (g - 2 h) T, h and g being the distances of the
    first two points from the end along the tangent.

    Parameters
    ----------
    start, end
        Points [m], unit tangents, curvature vectors [1/m], each of shape (n, n_axes).
    trim
        Length that the blend replaces on either side, shape (n, 2) [m].
    angle
        Turning angle at the joint, shape (n,) [rad].

    Returns
    -------
    array
        Shape (n, 6, n_axes) [m].
    """
    ratios = handle_ratios(angle)
    ends = []
    for (point, tangent, curvature), length, sense in (
        (start, trim[:, 0], 1.0), (end, trim[:, 1], -1.0),
    ):  # fmt: skip
        near, far = ((1.0 - ratio) * length for ratio in ratios)
        along = sense * tangent
        ends.append([
            point,
            point + near[:, None] * along,
            point + far[:, None] * along + (1.25 * near**2)[:, None] * curvature,
        ])  # fmt: skip
    return np.stack([*ends[0], *ends[1][::-1]], axis=1)
