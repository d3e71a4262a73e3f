"""Closing the loop: one run, several controllers, many runs."""

from contourlab.simulation.comparison import Comparison, compare
from contourlab.simulation.many import simulate_many
from contourlab.simulation.run import simulate

__all__ = ["Comparison", "compare", "simulate", "simulate_many"]
