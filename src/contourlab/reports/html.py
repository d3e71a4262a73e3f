"""A page as one file that holds everything it shows and asks nobody for anything.

plotly.js, styles and data are inside the file; a content security policy in its head forbids every
request, so that a defect cannot turn into one.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from contourlab.reports.palette import Look

__all__ = ["packed", "page_text", "script_json", "write_page"]


def write_page(text: Callable[[], str], file: str | FilePath, *, force: bool) -> FilePath:
    """Write a page, whole or not at all, and return its path.

    Parameters
    ----------
    text
        Makes the page; not called if the file may not be written.
    file
        Where, usually ``.html``.
    force
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        The file exists already, or cannot be written.
    """
    from contourlab.recordings.files import atomic_file, refuse_existing

    target = FilePath(file)
    refuse_existing(target, force=force)
    page = text()
    with atomic_file(target, force=force) as temporary:
        FilePath(temporary).write_text(page, encoding="utf-8")
    return target


def page_text(
    name: str, *, styles: Sequence[str], scripts: Sequence[str], data: Any, title: str,
    sentences: Sequence[str], looks: Sequence[Look] = (), **values: Any,
) -> str:  # fmt: skip
    """Return a page from its template.

    Parameters
    ----------
    name
        Of the template, which extends ``page.html``.
    styles, scripts
        Names of further files beside it, after ``page.css`` and ``theme.js``.
    data
        For the scripts.
    title, sentences
        The head of the page; the first sentence is the answer.
    looks
        Colours of the classes ``c0``, ``c1``, ...
    **values
        What else the template names.
    """
    import jinja2
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        loader=jinja2.FunctionLoader(_template),
    )  # fmt: skip
    return environment.get_template(name).render(
        title=title, sentences=sentences, looks=looks, **values,
        style=Markup("".join(map(_template, ("page.css", *styles)))),
        script=Markup("".join(map(_template, ("theme.js", *scripts)))),
        plotly=Markup(get_plotlyjs()), data=Markup(script_json(data)),
    )  # fmt: skip


@cache
def _template(name: str) -> str:
    return (files("contourlab.reports") / "templates" / name).read_text(encoding="utf-8")


def script_json(value: Any) -> str:
    """Return JSON that is safe inside a ``<script>`` element, whatever its strings hold.

    Parameters
    ----------
    value
        Of dicts, lists, strings, finite numbers, None.
    """
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def packed(values: Any) -> dict[str, str]:
    """Return numbers as base64: half the size of decimal text, and exact to seven digits.

    Parameters
    ----------
    values
        Whole or other numbers, in one dimension.
    """
    array = np.asarray(values)
    kind = "i4" if array.dtype.kind in "iu" else "f4"
    raw = np.ascontiguousarray(array, f"<{kind}").tobytes()
    return {"type": kind, "data": base64.b64encode(raw).decode("ascii")}
