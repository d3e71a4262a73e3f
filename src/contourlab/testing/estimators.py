"""Conformance of a contour error estimator: what it promises, and the geometry of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from contourlab.contour_errors.base import Estimator, EstimatorNeeds
from contourlab.contours.base import Contour
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.contours.wrapped import Reversed, Transformed
from contourlab.errors import RefusedError
from contourlab.recordings.reference import Reference
from contourlab.recordings.sample import Sample
from contourlab.testing.controllers import default_contours
from contourlab.testing.protocol import (
    check_frozen,
    check_needs,
    check_pure,
    check_state,
    check_traced,
    outputs,
    run,
)
from contourlab.testing.samples import make_samples, rest_to_rest, standing

__all__ = ["check_estimator"]

N_SAMPLES = 60
OFFSET = 1e-5
"""How far beside the contour the estimators are tried [m]."""


def check_estimator(
    estimator: Estimator,
    *,
    sample_time: float = 1e-3,
    contours: Sequence[Contour] | None = None,
    tolerance: float = 1e-12,
    exact_on_lines: bool = True,
) -> None:
    """Assert that an estimator keeps the contract of ``contourlab.contour_errors``.

    It is frozen, its needs are static, it is pure, can be scanned and gives the same numbers traced
    and not. On the contour it gives zero. Beside the contour with no lag it gives the offset, so
    that its vector runs from the actual point to the contour. On lines it is exact whatever the
    lag. It turns with the contour, does not mind the direction of the parameter or a reference
    that stands still, and has finite derivatives on a line.

    Parameters
    ----------
    estimator
        Any.
    sample_time
        [s].
    contours
        Curves to try beside the line; by default a circle and an ellipse or a helix, for each
        number of coordinates that the estimator takes.
    tolerance
        What counts as zero [m]; larger for an estimator that converges in time.
    exact_on_lines
        Whether a line is estimated without error whatever the lag.

    Raises
    ------
    AssertionError
        Something does not hold; says what.
    """
    name = type(estimator).__name__
    check_frozen(estimator)
    check_needs(estimator)
    needs = estimator.needs
    assert isinstance(needs, EstimatorNeeds), f"{name}.needs must be EstimatorNeeds"
    if contours is None:
        contours = [c for n in needs.coordinates or (2, 3, 4) for c in _curves(n)]
    for contour in contours:
        _check_on(estimator, contour, sample_time, tolerance, exact_on_lines)
    if needs.coordinates:
        n = max(needs.coordinates) + 1
        try:
            estimator.bind(Line(start=np.zeros(n), end=np.ones(n)), sample_time)
        except RefusedError:
            return
        raise AssertionError(f"{name} must refuse a contour with {n} coordinates")


def _curves(n_coordinates: int) -> list[Contour]:
    curves = default_contours(n_coordinates)
    if n_coordinates == 2:
        curves.append(Ellipse(semi_axes=np.array([0.03, 0.01]), rotation=np.array(0.3)))
    if n_coordinates == 3:
        curves.append(
            Helix(
                radius=np.array(0.02),
                pitch=np.array(0.01),
                turns=np.array(1.3),
                axis=np.array([0.3, 0.1, 1.0]),
            )
        )
    return curves


def _rotation(n: int) -> Any:
    q, r = np.linalg.qr(np.random.default_rng(3).normal(size=(n, n)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else q[:, [1, 0, *range(2, n)]]


def _normal_offset(contour: Contour, reference: Reference) -> Any:
    """Return unit vectors normal to the contour at every reference point, of one handedness."""
    tangent = np.asarray(jax.vmap(lambda p: contour.derivatives(p, 1)[1])(reference.parameter))
    tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    if contour.n_axes == 2:
        return np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    aside = np.cos(1.0 + 2.0 * np.arange(contour.n_axes))
    normal = aside - tangent * (tangent @ aside)[:, None]
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _check_on(
    estimator: Estimator,
    contour: Contour,
    sample_time: float,
    tolerance: float,
    exact_on_lines: bool,
) -> None:
    name, n = type(estimator).__name__, contour.n_axes
    where = f"{name} on {type(contour).__name__} in {n} coordinates"
    needs, reference = estimator.needs, rest_to_rest(contour, N_SAMPLES, sample_time)

    def samples_of(path: Contour, follow: Reference, error: Any = None) -> Sample:
        return make_samples(path, N_SAMPLES, sample_time, needs, error=error, reference=follow)

    def estimates(path: Contour, samples: Sample) -> Any:
        bound = estimator.bind(path, sample_time)
        return np.asarray(outputs(bound, samples))

    samples = samples_of(contour, reference)
    bound = estimator.bind(contour, sample_time)
    assert isinstance(bound, Estimator), f"{name}.bind must return an estimator"
    check_state(bound, samples, n)
    check_pure(bound, samples)
    check_traced(bound, samples)

    zero = estimates(contour, samples_of(contour, reference, np.zeros(n)))
    assert np.max(np.abs(zero)) <= tolerance, (
        f"{where} gives {np.max(np.abs(zero)):.3g} m on the contour, not 0"
    )

    offset = OFFSET * _normal_offset(contour, reference)
    beside = estimates(contour, samples_of(contour, reference, offset))
    worst = np.max(np.abs(beside - offset))
    # the foot point of an offset normal to the contour is the reference point, to every order
    assert worst <= 1e-6 * OFFSET + tolerance, (
        f"{where}: {OFFSET} m beside the reference point the vector from the actual point to the "
        f"contour is off by {worst:.3g} m (wrong sign?)"
    )

    given = estimates(contour, samples)
    assert np.all(np.isfinite(given)), f"{where} gives an estimate that is not finite"
    if isinstance(contour, Line) and exact_on_lines:
        error = np.asarray(samples.reference.position) - np.asarray(samples.position)
        tangent = np.asarray(contour.end) - np.asarray(contour.start)
        tangent = tangent / np.linalg.norm(tangent)
        exact = error - np.outer(error @ tangent, tangent)
        worst = np.max(np.abs(given - exact))
        assert worst <= tolerance, f"{where} is off by {worst:.3g} m: not exact on a line"

    turn = _rotation(n)
    turned_path = Transformed(inner=contour, matrix=turn, offset=np.zeros(n), similarity=True)
    turned = estimates(turned_path, samples_of(turned_path, _along(turned_path, reference),
                                               _errors(samples) @ turn.T))  # fmt: skip
    worst = np.max(np.abs(turned - given @ turn.T))
    assert worst <= tolerance, f"{where} changes by {worst:.3g} m when the plane is turned"

    back = Reversed(inner=contour)
    start, end = (float(np.asarray(x)) for x in contour.domain)
    mirrored = _along(back, reference, flip=start + end)
    backwards = estimates(back, samples_of(back, mirrored, _errors(samples)))
    worst = np.max(np.abs(backwards - given))
    assert worst <= tolerance, f"{where} changes by {worst:.3g} m when the contour is reversed"

    rest = standing(contour, N_SAMPLES, sample_time)
    at_rest = estimates(contour, samples_of(contour, rest, OFFSET * _normal_offset(contour, rest)))
    worst = np.max(np.abs(np.linalg.norm(at_rest, axis=1) - OFFSET))
    assert worst <= 1e-6 * OFFSET + tolerance, (
        f"{where} is off by {worst:.3g} m when the reference stands still"
    )

    slope = _slope(bound, samples, jnp.asarray(_errors(samples)))
    assert np.all(np.isfinite(slope)), f"{where} has a derivative that is not finite"


def _errors(samples: Sample) -> Any:
    return np.asarray(samples.reference.position) - np.asarray(samples.position)


def _moved(bound: Estimator, samples: Sample, errors: Any) -> Any:
    """Return the last estimate as a function of all tracking errors."""
    moved = eqx.tree_at(lambda s: s.position, samples, samples.reference.position - errors)
    return run(bound, moved)[0][-1]


@jax.jit
def _slope(bound: Estimator, samples: Sample, errors: Any) -> Any:
    return jax.jacrev(lambda e: _moved(bound, samples, e))(errors)


def _along(contour: Contour, reference: Reference, *, flip: float | None = None) -> Reference:
    """Return the same motion in time along another form of the contour."""
    sign = 1.0 if flip is None else -1.0
    parameter = np.asarray(reference.parameter)
    n = reference.n_samples
    return Reference.along(
        contour,
        sample_time=float(np.asarray(reference.sample_time)),
        parameter=parameter if flip is None else flip - parameter,
        parameter_rate=sign * np.asarray(reference.parameter_rate),
        parameter_acceleration=sign * np.asarray(reference.parameter_acceleration),
        parameter_jerk=np.zeros(n),
    )
