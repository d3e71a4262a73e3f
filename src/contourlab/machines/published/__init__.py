"""Machines of published papers, one file each, with what the source leaves open."""

from contourlab.machines.published.cao_zhang import (
    cao_zhang_emulated_stage,
    cao_zhang_stage,
    cao_zhang_stage_and_scanner,
)
from contourlab.machines.published.el_khalick import el_khalick_feed_drive
from contourlab.machines.published.ghaffari import ghaffari_three_axes, ghaffari_two_axes
from contourlab.machines.published.hu import hu_gantry
from contourlab.machines.published.meng import (
    meng_emulated_stage,
    meng_simulated_axes,
    meng_xy_stage,
)

__all__ = [
    "cao_zhang_emulated_stage",
    "cao_zhang_stage",
    "cao_zhang_stage_and_scanner",
    "el_khalick_feed_drive",
    "ghaffari_three_axes",
    "ghaffari_two_axes",
    "hu_gantry",
    "meng_emulated_stage",
    "meng_simulated_axes",
    "meng_xy_stage",
]
