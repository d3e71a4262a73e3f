"""Closing the loop: one run, several controllers and machines, many runs."""

from contourlab.simulation.chattering import Chattering, chattering, limit_cycle
from contourlab.simulation.comparison import Comparison, compare
from contourlab.simulation.draws import Listed, Normal, Uniform, Variation
from contourlab.simulation.many import simulate_many
from contourlab.simulation.run import simulate
from contourlab.simulation.spread import Spread, Statistic

__all__ = [
    "Chattering",
    "Comparison",
    "Listed",
    "Normal",
    "Spread",
    "Statistic",
    "Uniform",
    "Variation",
    "chattering",
    "compare",
    "limit_cycle",
    "simulate",
    "simulate_many",
]
