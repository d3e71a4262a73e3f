"""Samples along a contour, as a loop would hand them to a law: material for conformance checks."""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.contours.base import Contour
from contourlab.recordings.reference import Reference
from contourlab.recordings.sample import Sample

__all__ = ["make_samples", "rest_to_rest", "sample_at", "standing"]

AMPLITUDE = 2e-5
"""Of the tracking error that ``make_samples`` invents [m]."""


def rest_to_rest(
    contour: Contour, n: int, sample_time: float = 1e-3, *, share: float = 0.7
) -> Reference:
    """Return a reference that runs over part of a contour, from rest to rest.

    Parameters
    ----------
    contour
        The path.
    n
        Number of samples, two or more.
    sample_time
        [s].
    share
        Share of the domain that is run over, from its start.
    """
    start, end = (float(np.asarray(x)) for x in contour.domain)
    span, total = share * (end - start), (n - 1) * sample_time
    s = np.arange(n) / (n - 1)
    turn = 2.0 * np.pi
    return Reference.along(
        contour,
        sample_time=sample_time,
        parameter=start + span * (s - np.sin(turn * s) / turn),
        parameter_rate=span / total * (1.0 - np.cos(turn * s)),
        parameter_acceleration=span / total**2 * turn * np.sin(turn * s),
        parameter_jerk=span / total**3 * turn**2 * np.cos(turn * s),
    )


def standing(contour: Contour, n: int, sample_time: float = 1e-3, *, at: float = 0.4) -> Reference:
    """Return a reference that stands still on a contour.

    Parameters
    ----------
    contour
        The path.
    n
        Number of samples, two or more.
    sample_time
        [s].
    at
        Where, as a share of the domain.
    """
    start, end = (float(np.asarray(x)) for x in contour.domain)
    zero = np.zeros(n)
    return Reference.along(
        contour,
        sample_time=sample_time,
        parameter=zero + start + at * (end - start),
        parameter_rate=zero,
        parameter_acceleration=zero,
        parameter_jerk=zero,
    )


def make_samples(
    contour: Contour,
    n: int,
    sample_time: float = 1e-3,
    needs: Any = None,
    *,
    error: Any = None,
    reference: Reference | None = None,
) -> Sample:
    """Return samples of a loop whose tracking error is known, stacked: leading dimension n.

    Parameters
    ----------
    contour
        The path.
    n
        Number of samples, two or more.
    sample_time
        [s].
    needs
        Of a law or an estimator: decides the order of ``geometry`` and the rows of ``preview``.
    error
        Tracking error, reference - actual, shape (n_axes,) or (n, n_axes) [m]. By default sines of
        20 µm with a frequency and phase of their own on every axis.
    reference
        What the loop follows, with n samples; by default :func:`rest_to_rest`. A machine with a
        tool map needs one, in axes.
    """
    if reference is None:
        reference = rest_to_rest(contour, n, sample_time)
    preview = getattr(needs, "preview", 0)
    order = getattr(needs, "derivatives", -1)
    n_axes = reference.n_axes
    time = np.arange(n) * sample_time
    if error is None:
        # one to three periods over the record, never two axes alike
        rate = 2.0 * np.pi * (1.0 + 0.7 * np.arange(n_axes)) / (n * sample_time)
        angle = time[:, None] * rate + 0.4 + np.arange(n_axes)
        errors, error_rate = AMPLITUDE * np.sin(angle), AMPLITUDE * rate * np.cos(angle)
    else:
        errors = np.broadcast_to(np.asarray(error, float), (n, n_axes))
        error_rate = np.gradient(errors, sample_time, axis=0)
    points, rest = reference.points, reference.rest_point()
    rows = np.arange(n)[:, None] + 1 + np.arange(preview)

    def ahead(record: Any, last: Any) -> Any:
        padded = np.concatenate(
            [np.asarray(record), np.broadcast_to(last, (preview + 1, *np.shape(last)))]
        )
        return padded[rows]

    if order < 0:
        geometry: Any = np.zeros((n, 0, contour.n_axes))
    else:
        parameter = jnp.asarray(reference.parameter)
        geometry = np.asarray(_geometry(contour, parameter, order))
    # a Sample is one instant; many at once come out of vmap
    return jax.vmap(Sample)(
        time,
        points,
        geometry,
        jax.tree.map(ahead, points, rest),
        np.asarray(points.position) - errors,
        np.asarray(points.velocity) - error_rate,
    )


@functools.partial(jax.jit, static_argnums=2)
def _geometry(contour: Contour, parameter: Any, order: int) -> Any:
    return jax.vmap(lambda p: contour.derivatives(p, order))(parameter)


def sample_at(samples: Sample, k: int) -> Sample:
    """Return one of stacked samples.

    Parameters
    ----------
    samples
        As :func:`make_samples` made them.
    k
        Which.
    """

    def row(x: Any) -> Any:
        # picked by NumPy, and handed over as it is: no program is compiled for every shape
        return x[k] if isinstance(x, jax.core.Tracer) else jax.device_put(np.asarray(x)[k])

    picked: Sample = jax.tree.map(row, samples)
    return picked
