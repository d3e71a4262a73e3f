"""The polar plot of a circular test, as ISO 230-4 draws it, as inline SVG.

The nominal circle, radial deviations magnified about it, the start and the direction of each path,
the enveloping scale and the magnification.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from contourlab.reports.palette import look

if TYPE_CHECKING:
    from contourlab.evaluation import CircularTest

__all__ = ["polar_plot"]

_SIZE, _RADIUS = 640.0, 200.0
"""Of the picture and of the nominal circle in it."""
_REACH = 70.0
"""How far the largest deviation is drawn from the nominal circle, at most."""


def polar_plot(test: CircularTest) -> str:
    """Return the plot of a circular test.

    Parameters
    ----------
    test
        The test.
    """
    from markupsafe import escape

    largest = max(float(np.abs(one.radial).max()) for one in test.directions)
    division = _division(largest)
    steps = max(1, math.ceil(largest / division))
    per_metre = _REACH / (steps * division)
    # of the deviation beside the drawn circle, which stands for the nominal radius
    magnification = per_metre / (_RADIUS / test.radius)
    middle = _SIZE / 2.0
    rows = [
        f'<svg class="polar" viewBox="0 0 {_SIZE:g} {_SIZE:g}" role="img" '
        f'aria-label="polar plot of the circular test, deviations magnified">'
    ]
    for k in range(-steps, steps + 1):
        kind = "nominal" if k == 0 else "grid"
        rows.append(
            f'<circle class="{kind}" cx="{middle:g}" cy="{middle:g}" '
            f'r="{_RADIUS + k * division * per_metre:.2f}"/>'
        )
    edge = _RADIUS + _REACH + 18.0
    for x, y in ((edge, 0.0), (0.0, edge)):
        rows.append(
            f'<line class="grid" x1="{middle - x:g}" y1="{middle - y:g}" x2="{middle + x:g}" '
            f'y2="{middle + y:g}"/>'
        )
    rows.append(f'<text x="{middle + edge + 4:g}" y="{middle + 4:g}">{escape(test.axes[0])}</text>')
    rows.append(
        f'<text x="{middle:g}" y="{middle - edge - 6:g}" text-anchor="middle">'
        f"{escape(test.axes[1])}</text>"
    )
    for number, one in enumerate(test.directions):
        style = look(number)
        distance = _RADIUS + one.radial * per_metre
        x = middle + distance * np.cos(one.angle)
        y = middle - distance * np.sin(one.angle)
        keep = range(0, len(x), max(1, len(x) // 3000))
        points = "L".join(f"{x[k]:.2f} {y[k]:.2f}" for k in keep)
        rows.append(
            f'<path class="c{number}" d="M{points}" fill="none" stroke="var(--run)" '
            f'stroke-width="1.6"{_dash(style.dash)}/>'
        )
        rows.append(
            f'<circle class="c{number}" cx="{x[0]:.2f}" cy="{y[0]:.2f}" r="4" fill="var(--run)"/>'
        )
        rows.append(_arrow(number, middle, one.angle, x, y))
        rows.append(
            f'<text class="c{number}" x="{middle:g}" y="{middle - 30 + 22 * number:g}" '
            f'text-anchor="middle" style="fill: var(--run)">{one.name}: '
            f"G = {1e6 * one.deviation:.2f} µm</text>"
        )
    words = [f"division {1e6 * division:g} µm", f"magnification {_round(magnification)} : 1"]
    if test.bidirectional is not None:
        words.insert(0, f"G(b) = {1e6 * test.bidirectional:.2f} µm")
    for k, word in enumerate(words):
        rows.append(f'<text x="10" y="{_SIZE - 14 - 19 * (len(words) - 1 - k):g}">{word}</text>')
    rows.append(
        f'<text x="{_SIZE - 10:g}" y="{_SIZE - 14:g}" text-anchor="end">'
        f"R = {1e3 * test.radius:.5g} mm, dots: start</text>"
    )
    rows.append("</svg>")
    return "".join(rows)


def _division(largest: float) -> float:
    """Return a round step of which at most four reach the largest deviation."""
    if largest <= 0.0:
        return 1e-6
    power = 10.0 ** math.floor(math.log10(largest / 4.0))
    return next(m * power for m in (1.0, 2.0, 5.0, 10.0) if 4.0 * m * power >= largest)


def _round(value: float) -> str:
    return f"{float(f'{value:.3g}'):g}"


def _dash(dash: str) -> str:
    return {"solid": "", "dash": ' stroke-dasharray="7 4"'}.get(dash, ' stroke-dasharray="2 3"')


def _arrow(number: int, middle: float, angle: np.ndarray, x: np.ndarray, y: np.ndarray) -> str:
    """Return an arrow head a tenth of the way along a path."""
    k = min(max(len(x) // 10, 1), len(x) - 2)
    step = max(len(x) // 360, 1)
    dx, dy = x[k + step] - x[k], y[k + step] - y[k]
    del middle, angle
    turn = math.degrees(math.atan2(dy, dx))
    return (
        f'<path class="c{number}" transform="translate({x[k]:.2f} {y[k]:.2f}) rotate({turn:.1f})" '
        'd="M-5 -5L7 0L-5 5Z" fill="var(--run)"/>'
    )
