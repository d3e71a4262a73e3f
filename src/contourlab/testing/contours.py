"""The conformance check of contours: run it on a curve of your own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

from contourlab.contours.base import Contour

__all__ = ["check_contour"]

_ORDER = 4
"""Derivatives are compared with finite differences up to this order."""
_STEP = 1e-3
"""First step of the differences, as a fraction of the domain."""
_BATCH = 16
_STENCIL = {-2: 1.0 / 12.0, -1: -2.0 / 3.0, 1: 2.0 / 3.0, 2: -1.0 / 12.0}

Rows = NDArray[Any]


def check_contour(
    contour: Contour, *, parameters: Sequence[float] | Rows | None = None, seed: int = 0
) -> None:
    """Raise AssertionError unless a contour does what the rest of contourlab relies on.

    Checked are shapes and float64; a finite domain; every number finite in it; derivatives to
    order 4 against finite differences, order by order; ``locate`` and ``piece``; ``wrap``; that a
    closed contour closes; that arc length adds up and agrees with an independent quadrature; the
    Frenet frame of contours in two and three axes; that ``jit``, ``vmap`` and gradients pass, also
    with the contour as their argument; and that the contour cannot be changed.

    Parameters
    ----------
    contour
        The contour.
    parameters
        Where to check, inside the domain; 12 random places when None. Give them for a contour that
        has kinks inside a piece, and keep them away from the kinks.
    seed
        Of the random places.

    Raises
    ------
    AssertionError
        Something does not hold; the message says what, where and by how much.
    """
    name = type(contour).__name__
    start, end = _check_form(contour, name)
    if parameters is None:
        # not nearer to the ends than the differences reach
        places = np.random.default_rng(seed).uniform(start, end, 12)
        margin = 2.0 * _STEP * (end - start)
        places = np.clip(places, start + margin, end - margin)
    else:
        places = np.asarray(parameters, float)
        assert np.all((places >= start) & (places <= end)), "parameters must lie in the domain"
    rows = _batched(lambda p: contour.derivatives(p, _ORDER))
    points = _batched(lambda p: contour.position(p))
    samples = _check_samples(contour, name, places, rows, points)
    _check_finite(name, np.linspace(start, end, 64), rows)
    _check_differences(contour, name, places, rows)
    _check_pieces(contour, name, places, samples)
    _check_wrap(contour, name, places, samples, points)
    _check_length(contour, name, places, (start, end))
    if contour.n_axes in (2, 3):
        _check_frenet(contour, name, places)
    _check_transformations(contour, name, places, samples)


def _check_form(contour: Contour, name: str) -> tuple[float, float]:
    assert isinstance(contour, Contour), f"{name} must be a contourlab.contours.Contour"
    n_axes = contour.n_axes
    assert isinstance(n_axes, int), f"{name}.n_axes must be an int, got {n_axes!r}"
    assert n_axes >= 1, f"{name}.n_axes must be >= 1, got {n_axes}"
    assert isinstance(contour.closed, bool), f"{name}.closed must be a bool"
    domain = contour.domain
    assert len(domain) == 2, f"{name}.domain must be (start, end), got {domain!r}"
    start, end = float(domain[0]), float(domain[1])
    assert np.isfinite([start, end]).all(), f"{name}.domain must be finite, got {start}, {end}"
    assert end > start, f"{name}.domain must have end > start, got {start}, {end}"
    for leaf in jax.tree.leaves(contour):
        kind = getattr(leaf, "dtype", None)
        assert kind is not None, f"{name}: the leaf {leaf!r} is no array; declare it with real()"
        assert kind.kind != "f" or kind == np.float64, f"{name}: a leaf is {kind}, not float64"
    for field in dataclasses.fields(contour):
        try:
            setattr(contour, field.name, getattr(contour, field.name))
        except AttributeError:
            continue
        raise AssertionError(f"{name}.{field.name} can be assigned to: it must be frozen")
    return start, end


def _batched(function: Callable[[Any], Any]) -> Callable[[Rows], Rows]:
    """Return a function over any number of places, compiled once."""
    compiled = jax.jit(jax.vmap(function))

    def batched(places: Rows) -> Rows:
        filled = np.resize(places, -(-len(places) // _BATCH) * _BATCH).reshape(-1, _BATCH)
        values = np.concatenate([np.asarray(compiled(row)) for row in filled])
        return values[: len(places)]

    return batched


def _check_samples(
    contour: Contour,
    name: str,
    places: Rows,
    rows: Callable[[Rows], Rows],
    points: Callable[[Rows], Rows],
) -> Rows:
    """Return derivatives at the places, shape (n, order + 1, n_axes)."""
    at = jnp.asarray(places[0])
    position = contour.position(at)
    assert position.shape == (contour.n_axes,), (
        f"{name}.position must have shape {(contour.n_axes,)}, got {position.shape}"
    )
    assert position.dtype == np.float64, f"{name}.position must be float64, got {position.dtype}"
    samples = rows(places)
    for order in (0, 1, 2):
        shaped = jax.eval_shape(lambda p, k=order: contour.derivatives(p, k), at)
        assert shaped.shape == (order + 1, contour.n_axes), (
            f"{name}.derivatives(parameter, {order}) must have shape "
            f"{(order + 1, contour.n_axes)}, got {shaped.shape}"
        )
        assert shaped.dtype == np.float64, f"{name}.derivatives must be float64: {shaped.dtype}"
    low = np.asarray(jax.jit(jax.vmap(lambda p: contour.derivatives(p, 1)))(places))
    _close(low, samples[:, :2], f"{name}: derivatives of order 1 and {_ORDER} disagree", 1e-9)
    _close(points(places), samples[:, 0], f"{name}: position and derivatives row 0 disagree", 1e-12)
    return samples


def _check_finite(name: str, dense: Rows, rows: Callable[[Rows], Rows]) -> None:
    bad = ~np.isfinite(rows(dense)[:, :3]).all(axis=(1, 2))
    assert not bad.any(), f"{name}.derivatives is not finite at parameter {dense[bad][:1]}"


def _check_differences(
    contour: Contour, name: str, places: Rows, rows: Callable[[Rows], Rows]
) -> None:
    start, end = (float(value) for value in contour.domain)
    piece = jax.jit(jax.vmap(lambda p: contour.locate(p, jnp.int32(0))))
    # a stencil must stay within one piece and within the domain
    step = np.full(len(places), _STEP * (end - start))
    for _ in range(12):
        low, high = places - 2.0 * step, places + 2.0 * step
        crosses = np.asarray(piece(low) != piece(high)) | (low < start) | (high > end)
        step = np.where(crosses, 0.25 * step, step)
    places, step = places[~crosses], step[~crosses]
    assert len(places), f"{name}: no place is far enough from a joint; give parameters"
    exact = rows(places)
    coarse, fine = (
        sum(weight * rows(places + offset * h) for offset, weight in _STENCIL.items())
        / h[:, None, None]
        for h in (step, 0.5 * step)
    )
    for order in range(_ORDER):
        size = np.abs(exact[:, order]).max(axis=1, initial=0.0)
        largest = np.abs(exact[:, order + 1]).max(initial=0.0)
        # truncation as the two steps show it, and rounding of what is differenced
        allowed = 2.0 * np.abs(coarse - fine)[:, order].max(axis=1, initial=0.0)
        allowed = allowed + 1e-13 * size / step + 1e-9 * largest
        error = np.abs(fine[:, order] - exact[:, order + 1]).max(axis=1, initial=0.0)
        wrong = ~(error <= allowed)
        assert not wrong.any(), (
            f"{name}: derivative {order + 1} differs from the finite difference of derivative "
            f"{order} by {error[wrong][0]:.3g} at parameter {places[wrong][0]:.6g} "
            f"(its size there is {np.abs(exact[wrong][0, order + 1]).max():.3g})"
        )


def _check_pieces(contour: Contour, name: str, places: Rows, samples: Rows) -> None:
    @jax.jit
    @jax.vmap
    def found(place: Any, hint: Any) -> tuple[Any, Any]:
        piece = contour.locate(place, hint)
        return piece, contour.derivatives(place, _ORDER, piece)

    piece, rows = found(places, np.zeros(len(places), np.int32))
    assert np.asarray(piece).dtype == np.int32, f"{name}.locate must return int32"
    _close(np.asarray(rows), samples, f"{name}: derivatives with the located piece differ", 1e-12)
    again = np.asarray(found(places, np.roll(np.asarray(piece), 1))[0])
    if np.asarray(piece).any() or again.any():
        assert np.array_equal(again, piece), f"{name}.locate depends on where the search starts"


def _check_wrap(
    contour: Contour, name: str, places: Rows, samples: Rows, points: Callable[[Rows], Rows]
) -> None:
    start, end = (float(value) for value in contour.domain)
    period = end - start
    wrap = jax.jit(jax.vmap(contour.wrap))
    outside = np.concatenate([places, [start - 0.3 * period, end + 0.3 * period]])
    inside = np.asarray(wrap(outside))
    assert np.all((inside >= start) & (inside <= end)), f"{name}.wrap must return into the domain"
    _close(inside[:-2], places, f"{name}.wrap must leave the domain as it is", 1e-12)
    if not contour.closed:
        assert np.array_equal(inside[-2:], [start, end]), f"{name}.wrap must clip: it is open"
        return
    _close(
        inside[-2:], np.array([end - 0.3 * period, start + 0.3 * period]),
        f"{name}.wrap must go round: it is closed", 1e-9,
    )  # fmt: skip
    ends = points(np.array([start, end]))
    size = max(float(np.abs(samples[:, 0]).max()), float(np.ptp(samples[:, 0], axis=0).max()))
    gap = np.abs(ends[1] - ends[0]).max()
    assert gap <= 1e-9 * size, f"{name} says that it is closed, but its ends are {gap:.3g} m apart"
    turned = points(places + period)
    _close(turned, samples[:, 0], f"{name}.position must repeat: it is closed", 1e-9)


def _check_length(contour: Contour, name: str, places: Rows, domain: tuple[float, float]) -> None:
    start, end = domain
    middle = float(places[0])
    arc_length = jax.jit(lambda a, b: contour.arc_length(a, b))  # a bound method has no hash
    first, second = float(arc_length(start, middle)), float(arc_length(middle, end))
    whole = float(contour.length)
    assert 0.0 < whole < np.inf, f"{name}.length must be > 0 m and finite, got {whole}"
    for value, wanted, what in (
        (first + second, whole, "arc_length does not add up to length"),
        (float(arc_length(middle, start)), -first, "arc_length(b, a) must be -arc_length(a, b)"),
    ):
        assert abs(value - wanted) <= 1e-9 * whole, f"{name}: {what}: {value!r}, {wanted!r}"
    speed = jax.jit(lambda p: jnp.linalg.norm(contour.derivatives(p, 1)[1]))
    low, high = sorted((float(places[0]), float(places[len(places) // 2])))
    if high == low:
        high = end
    expected, uncertain = quad(lambda p: float(speed(p)), low, high, limit=200)
    stretch = float(arc_length(low, high))
    assert abs(stretch - expected) <= 1e-8 * whole + 2.0 * uncertain, (
        f"{name}.arc_length({low:.6g}, {high:.6g}) is {stretch!r}, the integral of the speed "
        f"is {expected!r}"
    )


def _check_frenet(contour: Contour, name: str, places: Rows) -> None:
    frame = jax.jit(jax.vmap(contour.frenet))(places)
    for field in dataclasses.fields(frame):
        value = getattr(frame, field.name)
        finite = value is None or np.isfinite(np.asarray(value)).all()
        assert finite, f"{name}.frenet: {field.name} is not finite"
    vectors = [frame.tangent, frame.normal, *([frame.binormal] if contour.n_axes == 3 else [])]
    axes = np.stack([np.asarray(v) for v in vectors], axis=1)
    product = axes @ np.swapaxes(axes, 1, 2)
    error = np.abs(product - np.eye(contour.n_axes)).max()
    assert error <= 1e-9, f"{name}.frenet is not orthonormal, by {error:.3g}"


def _check_transformations(contour: Contour, name: str, places: Rows, samples: Rows) -> None:
    at = jnp.asarray(places[0])

    @jax.jit
    def everything(contour: Any, at: Any) -> tuple[Any, Any, Any]:
        def point(p: Any) -> Any:
            return contour.position(p, contour.locate(p, jnp.int32(0)))

        return point(at), jax.jacfwd(point)(at), jax.jacrev(point)(at)

    point, forward, reverse = everything(contour, at)
    _close(np.asarray(point), samples[0, 0], f"{name} differs as the argument of jit", 1e-12)
    _close(np.asarray(forward), samples[0, 1], f"{name}: jacfwd is not derivative 1", 1e-9)
    _close(np.asarray(reverse), samples[0, 1], f"{name}: jacrev is not derivative 1", 1e-9)
    numbers, rest = eqx.partition(contour, eqx.is_inexact_array)
    gradient = jax.jit(
        jax.grad(lambda numbers: jnp.sum(eqx.combine(numbers, rest).derivatives(at, 1)))
    )(numbers)
    for leaf in jax.tree.leaves(gradient):
        assert np.isfinite(leaf).all(), f"{name}: the gradient through its fields is not finite"


def _close(actual: Rows, wanted: Rows, message: str, tolerance: float) -> None:
    """Raise AssertionError unless two arrays agree to a fraction of the second's size."""
    error = float(np.abs(actual - wanted).max(initial=0.0))
    size = float(np.abs(wanted).max(initial=0.0))
    assert error <= tolerance * size, f"{message}, by {error:.3g} (of {size:.3g})"
