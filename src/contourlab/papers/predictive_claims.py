"""Predictive contouring: when a claim of the paper holds, and why it fails where it does.

The claims are that a larger weight of the error across the path, and a smaller one of the commands
across it, lower the contour error. One holds if the rms falls by 5 % or more and the largest error
falls too. A reason is given only where the closed loops bear it out; what is left is "not
explained".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from contourlab.papers.paper import change_percent, close
from contourlab.papers.predictive_runs import (
    CONTOUR,
    EQUAL,
    LOWERED,
    ONE_ANGLE,
    RAISED,
    Case,
    Errors,
)

__all__ = ["FALL", "Found", "base_of", "falls", "holds", "why"]

Found = Mapping[Case, Errors]
"""Errors of every closed loop [um]."""
FALL = 5.0
"""By how many percent the rms has to fall [%]."""


def falls(before: Errors, after: Errors) -> bool:
    """Return whether an rms falls by as much as a claim asks for.

    Parameters
    ----------
    before, after
        Of two loops.
    """
    return change_percent(before.rms, after.rms) >= FALL


def holds(before: Errors, after: Errors) -> bool:
    """Return whether a claim holds between two loops.

    Parameters
    ----------
    before, after
        Of the loops.
    """
    return falls(before, after) and after.largest < before.largest


def base_of(found: Found, case: Case) -> Errors:
    """Return what a case is measured against: equal weights, or the axis law (9), which is that.

    Parameters
    ----------
    found
        Errors of every case.
    case
        Which.
    """
    equal = case._replace(weights=EQUAL)
    return found[equal] if equal in found else found[equal._replace(axis=True)]


class Reason(NamedTuple):
    """Why a claim fails."""

    change: str | None
    """At which change of the assumed settings; any if None."""
    weights: tuple[str, ...]
    """Of which weights."""
    text: str
    borne_out: Callable[[Found, Case], bool]
    """Whether the loops say so."""


def why(found: Found, case: Case) -> str:
    """Return the reasons for which the claim of a case fails.

    Parameters
    ----------
    found
        Errors of every case.
    case
        Which.
    """
    reasons = [
        reason.text
        for reason in REASONS
        if reason.change in (None, case.change)
        and case.weights in reason.weights
        and reason.borne_out(found, case)
    ]
    return "; ".join(reasons) or "not explained"


def _unchanged(found: Found, case: Case) -> bool:
    return close(found[case].rms, base_of(found, case).rms)


def _angle_does_it(found: Found, case: Case) -> bool:
    single = case._replace(change=ONE_ANGLE)
    return (
        single in found
        and _unchanged(found, single)
        and found[case].rms > 2.0 * found[single].rms
    )  # fmt: skip


def _all_alike(found: Found, case: Case) -> bool:
    base = base_of(found, case).rms
    return all(close(found[case._replace(weights=w)].rms, base, 0.01) for w in (CONTOUR, LOWERED))


def _holds_at(change: str) -> Callable[[Found, Case], bool]:
    """Return whether the same claim holds at another change."""

    def borne_out(found: Found, case: Case) -> bool:
        other = case._replace(change=change)
        return holds(base_of(found, other), found[other])

    return borne_out


def _kept(found: Found, case: Case) -> bool:
    """Return whether a curve is missed by the square of the feed, and less with free commands."""
    still, fast = (
        found[case._replace(weights=EQUAL, change=change)].rms
        for change in ("no friction", "ten times faster")
    )
    free = case._replace(change=f"{case.change}, H_c = 10")
    return close(fast, 100.0 * still) and falls(base_of(found, free), found[free])


def _only_rms_falls(found: Found, case: Case) -> bool:
    base = base_of(found, case)
    return falls(base, found[case]) and not holds(base, found[case])


def _follows_noise(found: Found, case: Case) -> bool:
    """Return whether noise makes most of the error, and the more the stiffer the law."""
    rms = [found[case._replace(weights=w)].rms for w in (EQUAL, CONTOUR, LOWERED)]
    quiet = found[case._replace(weights=EQUAL, change="")].rms
    return rms[0] > 2.0 * quiet and rms[0] < rms[1] < rms[2]


def _force_does_it(found: Found, case: Case) -> bool:
    base = base_of(found, case)
    peaks_fall = found[case].largest < base.largest
    return peaks_fall and _holds_at("cutting force at 10 Hz")(found, case)


_KEPT = (
    "a command that is kept from the fifth sample to the twentieth misses a curve, by the square "
    "of the feed, and the larger weight enlarges that; with H_c = 10 (below) the rms falls"
)

REASONS: tuple[Reason, ...] = (
    Reason(None, (RAISED,), "nothing is gained: across the path rho_n / rho_cn is what it was, "
           "and so is the rms, within 5 %", _unchanged),
    Reason("", (RAISED,), "with the angle of each sample ahead, commands that are a thousand times "
           "cheaper across the tangent are pushed across the path as the tangent turns within the "
           "horizon; with one angle for the horizon (below) they are not, and the rms is what it "
           "was, within 5 %", _angle_does_it),
    Reason("H_c = 1", (CONTOUR, LOWERED), "one command for the whole horizon is fitted to all "
           "outputs: their common weight cancels, and that of the input is nothing beside it; all "
           "weights leave the same rms, within 1 %", _all_alike),
    Reason("H_p = 30", (CONTOUR,), "five free commands are too coarse for 0.15 s: the fifth is "
           "kept for 25 samples, and the larger weight asks for more than they can do; with "
           "H_c = 10 the claim holds", _holds_at("H_p = 30, H_c = 10")),
    Reason("no friction", (CONTOUR,), f"without a disturbance a few nanometres are left: {_KEPT}",
           _kept),
    Reason("ten times faster", (CONTOUR,), _KEPT, _kept),
    Reason("ten times faster, H_c = 10", (CONTOUR,), "the rms falls; the largest error, where "
           "friction turns round, does not", _only_rms_falls),
    Reason("noise of 0.1 um", (CONTOUR, LOWERED), "the law follows noise: the stiffer across the "
           "path, the more", _follows_noise),
    Reason("cutting force", (CONTOUR,), "the peaks of friction are lower, but what the force at "
           "30 Hz leaves is larger, as behind every feedback at some frequencies; at 10 Hz the "
           "claim holds", _force_does_it),
)  # fmt: skip
"""What is known; given where the loops bear it out."""
