"""Text files from the package's templates."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2

__all__ = ["render"]

_ENVIRONMENT = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
    autoescape=False,
)


def render(template: str, values: Mapping[str, Any]) -> str:
    """Return a template filled in.

    Parameters
    ----------
    template
        Its path under ``templates``.
    values
        What it names; a name that is missing is our mistake and raises.
    """
    return _ENVIRONMENT.get_template(template).render(**values)
