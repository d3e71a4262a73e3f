"""What a stabiliser's gain that was given holds for: stability at the corners, and a certificate.

Whatever gain is asked for, x(k+1) = (A(α) + b K) x(k) of :mod:`~contourlab.controllers.stabiliser`
must be stable wherever α may be. Two things are looked at.

*Corners.* At each corner of a box of α about (-2, 1), α standing still, the largest eigenvalue must
be inside the unit circle, or below the decay that is asked for. This is necessary: a gain that
fails is no stabiliser.

*Certificate.* In which box does one quadratic form x' P x fall however α moves? A is affine in α
and the condition convex in it, so that the corners of the box decide. The forms that are tried are

    P = I + γ mean(A_i' P A_i),   i the corners of a box of width w,                     (F)

linear in P; at w = 0 that is Lyapunov's equation at (-2, 1). For each the largest box is found by
halving, and the largest of all is taken: no solver is needed, and what is reported has been
checked. On the published gains it is within 1 % of the best that a search over all forms finds
(:func:`~contourlab.controllers.stabiliser.certified_half_width`; a test).

References
----------
.. [CaoZhang] (37), Lemma 5.3 with one Q for all corners.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.stabiliser import CENTRE, closed_loop, falling_margin

__all__ = ["GainCertificate", "certify_gain", "worst_radius"]

WIDEST = 2.0
"""Largest half width that is looked at: α1 = 0 and -4."""
HALVINGS = 20
WIDTHS = tuple(0.05 * k for k in range(12))
"""w of (F)."""
SHARES = (0.5, 0.9)
"""γ of (F), as a share of the largest for which there is a P."""


@dataclass(frozen=True)
class GainCertificate:
    """What a given gain holds for."""

    half_width: float
    """Of the box of α for which the form certifies the gain; 0 if it does not even at (-2, 1)."""
    margin: float
    """Least eigenvalue of P - A' P A over that box, relative to the largest of P."""


def worst_radius(numerator: Any, gain: Any, half_width: float) -> tuple[float, NDArray[Any]]:
    """Return the largest spectral radius at the corners of a box and its middle, and where it is.

    Parameters
    ----------
    numerator
        b of the axis, shape (n,).
    gain
        K, shape (n,) [command unit per m].
    half_width
        Of the box of α about (-2, 1).
    """
    points = [CENTRE, *_corners(half_width)]
    radii = [
        float(np.max(np.abs(np.linalg.eigvals(closed_loop(alpha, numerator, gain)))))
        for alpha in points
    ]
    worst = int(np.argmax(radii))
    return radii[worst], points[worst]


def certify_gain(numerator: Any, gain: Any, *, at_most: float = WIDEST) -> GainCertificate:
    """Return the largest box in which a form (F) certifies a constant gain.

    Parameters
    ----------
    numerator
        b of the axis, shape (n,).
    gain
        K, shape (n,) [command unit per m].
    at_most
        Half width beyond which nothing is asked.
    """
    forms = [form for width in WIDTHS for form in _forms(numerator, gain, width)]
    found = [_widest(numerator, gain, form, at_most) for form in forms]
    return max(found, key=lambda one: (one.half_width, one.margin))


def _forms(numerator: Any, gain: Any, width: float) -> list[NDArray[Any]]:
    """Return P of (F) for a box, for γ up to where there is none."""
    loops = [closed_loop(alpha, numerator, gain) for alpha in _corners(width)]
    n = len(loops[0])
    mean = sum(np.kron(loop.T, loop.T) for loop in loops) / len(loops)
    largest = float(np.max(np.abs(np.linalg.eigvals(mean))))
    found = []
    for share in SHARES:
        factor = share / max(largest, 1e-300)
        form = np.linalg.solve(np.eye(n * n) - factor * mean, np.eye(n).ravel()).reshape(n, n)
        found.append(0.5 * (form + form.T))
    return found


def _widest(
    numerator: Any, gain: Any, form: NDArray[Any], at_most: float
) -> GainCertificate:  # fmt: skip
    def margin(half_width: float) -> float:
        loops = [closed_loop(alpha, numerator, gain) for alpha in _corners(half_width)]
        return min(falling_margin(loop, form, form, 1.0) for loop in loops)

    if (whole := margin(at_most)) > 0.0:
        return GainCertificate(at_most, whole)
    low, high = 0.0, at_most
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if margin(middle) > 0.0 else (low, middle)
    return GainCertificate(low, max(margin(low), 0.0))


def _corners(half_width: float) -> list[NDArray[Any]]:
    return [
        CENTRE + half_width * np.array(signs) for signs in itertools.product((-1.0, 1.0), repeat=2)
    ]
