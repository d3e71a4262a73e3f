"""Published experiments, done again: what the paper printed, what comes out, and why.

One file per paper; its name with hyphens is the paper's slug. A file offers ``PAPER``, and that is
all it takes to be found.
"""

from contourlab.papers.registry import Paper, paper_named, papers, reproduce

__all__ = ["Paper", "paper_named", "papers", "reproduce"]
