"""What the accuracy study knows by name: contours at stated sizes, estimators at their defaults."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import snake_case
from contourlab.contour_errors.base import Estimator
from contourlab.contour_errors.extended_natural_local import ExtendedNaturalLocalEstimator
from contourlab.contour_errors.foot_point import FootPointEstimator
from contourlab.contour_errors.global_task_frame import GlobalTaskFrameEstimator
from contourlab.contour_errors.natural_local import NaturalLocalEstimator
from contourlab.contour_errors.newton import NewtonEstimator
from contourlab.contour_errors.osculating_circle import OsculatingCircleEstimator
from contourlab.contour_errors.tangent import TangentEstimator
from contourlab.contour_errors.variable_gain import VariableGainEstimator
from contourlab.contours import (
    Arc,
    Circle,
    Contour,
    Ellipse,
    FigureEight,
    Heart,
    Helix,
    Involute,
    Line,
    Lissajous,
    Parabola,
    Sinusoid,
    Spiral,
    Star,
)
from contourlab.errors import ConfigurationError, choices

__all__ = ["DEFAULT_CONTOURS", "named", "study_contours", "study_estimators", "study_named"]

T = TypeVar("T")

DEFAULT_CONTOURS = ("ellipse", "figure_eight", "parabola", "helix")
"""Of the study, if none are named."""


def study_contours() -> dict[str, Contour]:
    """Return the contours that the accuracy study knows by name.

    Ellipse, figure of eight and parabola have the sizes of the papers, the helix is the paper's
    made circular; the rest are of the same extent.

    Returns
    -------
    dict
        By the class's name in snake case.
    """
    return {
        "arc": Arc(center=_at(0.0, 0.0), start=_at(0.03, 0.0), angle=_at(0.5 * np.pi)),
        "circle": Circle(radius=_at(0.03)),
        "ellipse": Ellipse(semi_axes=_at(0.03, 0.01)),
        "figure_eight": FigureEight(half_sizes=_at(0.03, 0.03)),
        "heart": Heart(radius=_at(0.03)),
        "helix": Helix(radius=_at(0.03), pitch=_at(0.1), turns=_at(2.0)),
        "involute": Involute(base_radius=_at(0.01), start_angle=_at(0.5), end_angle=_at(4.0)),
        "line": Line(start=_at(0.0, 0.0), end=_at(0.06, 0.03)),
        "lissajous": Lissajous(
            amplitudes=_at(0.03, 0.03), frequencies=(3.0, 2.0), phases=_at(0.0, 0.5)
        ),
        "parabola": Parabola(coefficient=_at(50.0), half_width=_at(0.02)),
        "sinusoid": Sinusoid(amplitude=_at(0.01), wavelength=_at(0.06)),
        "spiral": Spiral(start_radius=_at(0.005), pitch=_at(0.005), turns=_at(3.0)),
        "star": Star(outer_radius=_at(0.03), inner_radius=_at(0.02)),
    }


def _at(*values: float) -> NDArray[np.float64]:
    return np.asarray(values if len(values) > 1 else values[0], np.float64)


def study_estimators() -> dict[str, Estimator]:
    """Return the estimators that the accuracy study knows by name, at their defaults.

    Returns
    -------
    dict
        By the class's name in snake case without ``Estimator``, the simple ones first;
        ``newton_projected`` and ``newton_filtered`` are the other forms of ``newton``.
    """
    return {
        "tangent": TangentEstimator(),
        "osculating_circle": OsculatingCircleEstimator(),
        "variable_gain": VariableGainEstimator(),
        "natural_local": NaturalLocalEstimator(),
        "extended_natural_local": ExtendedNaturalLocalEstimator(),
        "global_task_frame": GlobalTaskFrameEstimator(),
        "newton": NewtonEstimator(),
        "newton_projected": NewtonEstimator(form="projected"),
        "newton_filtered": NewtonEstimator(form="filtered"),
        "foot_point": FootPointEstimator(),
    }


def study_named(contours: Any) -> dict[str, Contour]:
    """Return the contours of a study by name; see ``named``.

    Parameters
    ----------
    contours
        Contours, names of ``study_contours``, or both; the study's own if None.
    """
    given = DEFAULT_CONTOURS if contours is None else contours
    return named("contour", given, Contour, study_contours())


def named(kind: str, given: Any, base: type[Any], known: Mapping[str, T]) -> dict[str, T]:
    """Return objects by name, from names, objects, a sequence of them, or a mapping.

    Parameters
    ----------
    kind
        What they are, for the message.
    given
        Names (hyphens count as underscores) or objects; the keys of a mapping name its objects.
    base
        Class of the objects.
    known
        What names stand for.

    Raises
    ------
    ConfigurationError
        An unknown name, something else than ``base``, one name twice, or nothing at all.
    """
    if isinstance(given, Mapping):
        pairs = [(str(name), value) for name, value in given.items()]
    else:
        single = isinstance(given, str | base) or not isinstance(given, Iterable)
        entries = [given] if single else list(given)
        pairs = [_pair(kind, entry, base, known) for entry in entries]
    if not pairs:
        raise ConfigurationError(f"no {kind} is given; {choices('', known)}")
    found: dict[str, T] = {}
    for name, value in pairs:
        if not isinstance(value, base):
            raise ConfigurationError(
                f"{kind} {name!r} must be of class {base.__name__}, got {value!r:.60}"
            )
        if name in found:
            raise ConfigurationError(
                f"{kind} {name!r} is given twice; a mapping gives each a name of its own"
            )
        found[name] = value
    return found


def _pair(kind: str, entry: Any, base: type[Any], known: Mapping[str, T]) -> tuple[str, Any]:
    if isinstance(entry, str):
        key = entry.strip().replace("-", "_")
        if key not in known:
            raise ConfigurationError(f"unknown {kind} {entry.strip()!r}; {choices(key, known)}")
        return key, known[key]
    own = type(entry).__name__
    return snake_case(own.removesuffix("Estimator") if base is Estimator else own), entry
