"""One fixed look per run, the same in every figure, on the page and on paper.

The colours are Okabe and Ito's, told apart by people with any of the common colour vision
deficiencies; the dark page uses lighter ones of the same hue. After six controllers the colours
come again with another dash. On a second machine a controller keeps its colour, with another dash
and another marker.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Look", "look"]

_COLOURS = (
    ("#0072b2", "#4ea8de"),  # blue
    ("#d55e00", "#f0894a"),  # vermilion
    ("#009e73", "#35c79e"),  # bluish green
    ("#b0558a", "#dd8fbb"),  # reddish purple
    ("#b07d00", "#e6b422"),  # ochre: their yellow is too light on white
    ("#3d6b8c", "#9fc3da"),  # slate: their sky blue, apart from the first in lightness
)
_DASHES = (("solid", "-"), ("dash", "--"), ("dot", ":"), ("dashdot", "-."))
_MARKERS = (("circle", "o"), ("square", "s"), ("diamond", "D"), ("triangle-up", "^"),
            ("pentagon", "p"), ("triangle-down", "v"))  # fmt: skip


@dataclass(frozen=True)
class Look:
    """Colour on light and dark ground, dash and marker, in plotly's and in matplotlib's words."""

    light: str
    dark: str
    dash: str
    line_style: str
    symbol: str
    marker: str


def look(number: int, machine: int = 0) -> Look:
    """Return the look of a controller on a machine.

    Parameters
    ----------
    number
        Its place among the controllers, from 0.
    machine
        The machine's place among the machines, from 0.
    """
    round_, place = divmod(number, len(_COLOURS))
    dash = _DASHES[(round_ + machine) % len(_DASHES)]
    return Look(*_COLOURS[place], *dash, *_MARKERS[(place + machine) % len(_MARKERS)])
