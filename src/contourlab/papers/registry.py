"""Which papers there are: every module of this package that offers ``PAPER``."""

from __future__ import annotations

import functools
import importlib
import pkgutil

from contourlab.errors import ConfigurationError, choices
from contourlab.papers.paper import Paper, Progress
from contourlab.reports.reproduction import Reproduction

__all__ = ["Paper", "paper_named", "papers", "reproduce"]


@functools.cache
def papers() -> dict[str, Paper]:
    """Return the papers by slug, such as ``"natural-local"``."""
    import contourlab.papers as package

    found = {}
    for module in pkgutil.iter_modules(package.__path__):
        paper = getattr(importlib.import_module(f"{package.__name__}.{module.name}"), "PAPER", None)
        if paper is not None:
            found[paper.slug] = paper
    return dict(sorted(found.items()))


def paper_named(slug: str) -> Paper:
    """Return a paper.

    Parameters
    ----------
    slug
        Underscores count as hyphens.

    Raises
    ------
    ConfigurationError
        No such paper; lists those there are.
    """
    key = slug.replace("_", "-")
    if key not in papers():
        raise ConfigurationError(f"unknown paper {slug!r}; {choices(key, papers())}")
    return papers()[key]


def reproduce(paper: str, *, progress: Progress | None = None) -> Reproduction:
    """Run a paper's experiments and compare with what it printed.

    Parameters
    ----------
    paper
        Its slug, such as ``"natural-local"``.
    progress
        Called with the paper's slug and the fraction done, 0 to 1.

    Returns
    -------
    Reproduction
        Rows of published and reproduced figures with a verdict, curves, and what was assumed.

    Raises
    ------
    ConfigurationError
        No such paper.
    """
    return paper_named(paper).run(progress or (lambda _name, _done: None))
