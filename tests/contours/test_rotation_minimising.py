"""Rotation-minimising frames: closed forms, order of convergence, inflections, corners."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from contourlab.configuration import real
from contourlab.contours.base import Contour
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.figure_eight import FigureEight
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.contours.rotation_minimising import (
    begin_frame,
    move_frame,
    rotation_minimising_frames,
    transport_normal,
)
from contourlab.errors import GeometryError


class Quintic(Contour):
    """(t, t³, t⁵ + t⁴/2): straight at 0, where its Frenet normal jumps by 180°."""

    size: jax.Array = real(default=1.0)

    n_axes = property(lambda self: 3)
    domain = property(lambda self: (-1.0, 1.0))
    closed = property(lambda self: False)

    def position(self, parameter, piece=None):
        t = jnp.asarray(parameter)
        return self.size * jnp.stack([t, t * t * t, t**5 + 0.5 * t**4])


def test_on_a_helix_the_normal_turns_back_at_the_rate_of_the_torsion():
    r, pitch = 0.5, 0.7
    c = pitch / (2 * np.pi)
    helix = Helix(radius=r, pitch=pitch, turns=1.0)
    places = np.linspace(0.0, 2 * np.pi, 400)
    frames = rotation_minimising_frames(helix, places)
    frenet = jax.jit(jax.vmap(helix.frenet))(places)
    # seen from the Frenet frame u1 is (cos φ, sin φ), and begins as the normal
    turned = np.unwrap(np.arctan2(
        np.sum(frames.normal * np.asarray(frenet.binormal), axis=1),
        np.sum(frames.normal * np.asarray(frenet.normal), axis=1),
    ))  # fmt: skip
    curvature, torsion = r / (r * r + c * c), c / (r * r + c * c)
    s = np.hypot(r, c) * places
    assert_allclose(turned, -torsion * s, rtol=0, atol=1e-8)  # fourth order, 400 steps
    assert_allclose(frames.curvature, curvature * np.cos(torsion * s), rtol=0, atol=1e-7)
    assert_allclose(frames.second_curvature, curvature * np.sin(torsion * s), rtol=0, atol=1e-7)


def judged(contour, end):
    """Return the normal carried from -0.9 to a parameter by scipy: u' = -(u . t') t."""
    third = jax.jit(lambda p: contour.derivatives(p, 2))

    def rate(p, u):
        d = np.asarray(third(p))
        speed = np.linalg.norm(d[1])
        t = d[1] / speed
        bend = (d[2] - t * (t @ d[2])) / speed
        return -(u @ bend) * t

    first = np.array(begin_frame(contour.derivatives(jnp.asarray(-0.9), 2))[0].normal)
    return solve_ivp(rate, (-0.9, end), first, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


def test_the_error_falls_with_the_fourth_power_of_the_spacing():
    curve = Quintic()
    exact = judged(curve, 0.8)
    counts = np.array([20, 40, 80])
    errors = [
        np.linalg.norm(rotation_minimising_frames(curve, np.linspace(-0.9, 0.8, n + 1)).normal[-1]
                       - exact)
        for n in counts
    ]  # fmt: skip
    slopes = -np.diff(np.log(errors)) / np.diff(np.log(counts))
    assert np.all(np.abs(slopes - 4.0) < 0.3), slopes
    assert errors[-1] < 1e-5


def test_it_goes_through_a_spatial_inflection_without_turning():
    curve = Quintic()
    places = np.linspace(-0.2, 0.2, 401)
    frames = rotation_minimising_frames(curve, places)
    frenet = jax.jit(jax.vmap(curve.frenet))(places)
    jump = np.max(np.linalg.norm(np.diff(np.asarray(frenet.normal), axis=0), axis=1))
    assert jump > 1.9  # the Frenet normal turns over at the inflection
    # a step turns no more than the tangent does: curvature (up to 1.4) times a step of 0.001
    assert np.max(np.linalg.norm(np.diff(frames.normal, axis=0), axis=1)) < 1.5e-3
    # the signed curvatures pass through zero smoothly and have the size of the curvature
    size = np.hypot(frames.curvature, frames.second_curvature)
    assert_allclose(size, frenet.curvature, rtol=0, atol=1e-12)
    assert np.max(np.abs(np.diff(frames.curvature))) < 0.01
    assert frames.curvature[0] * frames.curvature[-1] < 0.0
    axes = np.stack([frames.tangent, frames.normal, frames.binormal], axis=1)
    assert_allclose(axes @ np.swapaxes(axes, 1, 2), np.eye(3)[None].repeat(401, 0), atol=1e-14)
    assert_allclose(np.linalg.det(axes), 1.0)


def test_a_planar_frame_is_the_frenet_frame_through_every_inflection():
    eight = FigureEight(half_sizes=(0.03, 0.02))
    places = np.linspace(0.0, 6.0, 50)
    frames = rotation_minimising_frames(eight, places)
    frenet = jax.jit(jax.vmap(eight.frenet))(places)
    assert_allclose(frames.normal, frenet.normal, rtol=0, atol=1e-13)
    assert_allclose(frames.curvature, frenet.curvature, rtol=0, atol=1e-10)
    assert frames.binormal is None
    assert frames.second_curvature is None


def test_a_planar_curve_in_space_keeps_its_normal_in_the_plane_or_across_it():
    # a circle's transport is exact for any step: the reflections are symmetric
    helix = Helix(radius=0.5, pitch=0.0, turns=1.0)
    frames = rotation_minimising_frames(helix, np.linspace(0, 6, 7), normal=(0.3, 0.0, 1.0))
    assert_allclose(frames.normal @ [0, 0, 1.0], frames.normal[0, 2], rtol=0, atol=1e-14)


def test_the_loop_and_the_record_are_one():
    helix = Helix(radius=0.5, pitch=0.7, turns=1.0)
    places = np.linspace(0.0, 1.0, 5)
    record = rotation_minimising_frames(helix, places)
    step = jax.jit(lambda kept, p: move_frame(kept, helix.derivatives(p, 2)))
    kept, _ = begin_frame(helix.derivatives(jnp.asarray(places[0]), 2))
    for k in range(1, 5):
        kept, frame = step(kept, places[k])
        assert_allclose(frame.normal, record.normal[k], rtol=0, atol=1e-15)
        assert_allclose(kept.normal, frame.normal)


def test_many_small_steps_do_not_drift():
    ellipse = Ellipse(semi_axes=(0.03, 0.01))

    @jax.jit
    def carried(n):
        def body(k, kept):
            p = 0.3 + 0.001 * (k % 6283)
            return move_frame(kept, ellipse.derivatives(p, 2))[0]

        return jax.lax.fori_loop(1, n, body, begin_frame(ellipse.derivatives(0.3, 2))[0])

    kept = carried(200_000)
    assert_allclose(jnp.linalg.norm(kept.normal), 1.0, rtol=1e-15)
    assert_allclose(kept.normal, [-kept.tangent[1], kept.tangent[0]], rtol=0, atol=1e-14)


def test_corners_standing_still_and_turning_straight_back():
    x, y, z = np.eye(3)
    at = np.array([0.2, 0.1, 0.0])
    # a corner from x to y: the smallest rotation takes y to -x, and leaves z
    assert_allclose(transport_normal(y, at, x, at, y), -x, rtol=0, atol=1e-15)
    assert_allclose(transport_normal(z, at, x, at, y), z, rtol=0, atol=1e-15)
    assert_allclose(transport_normal(y, at, x, at, x), y, rtol=0, atol=1e-15)
    assert_allclose(transport_normal(y, at, x, at, -x), y, rtol=0, atol=1e-15)
    # standing still with no tangent of its own: the frame waits
    kept, _ = begin_frame(np.stack([at, x, y]))
    waiting, frame = move_frame(kept, np.stack([at, 0 * x, 0 * x]))
    assert_allclose(waiting.normal, kept.normal)
    assert_allclose(frame.tangent, x)
    assert float(frame.curvature) == 0.0
    for gradient in jax.jacfwd(transport_normal, argnums=(1, 3))(y, at, x, at, x):
        assert np.isfinite(gradient).all()


def test_a_straight_line_begins_with_the_stated_perpendicular():
    frames = rotation_minimising_frames(Line(start=(0, 0, 0), end=(1.0, 2.0, 2.0)), [0.0, 1.0])
    tangent = np.array([1.0, 2.0, 2.0]) / 3.0
    normal = np.array([1.0, 0.0, 0.0]) - tangent / 3.0
    assert_allclose(frames.normal, [normal / np.linalg.norm(normal)] * 2, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("contour", "parameters", "normal", "message"),
    [
        (Quintic(), [[0.0]], None, r"parameters must have shape \(n,\)"),
        (Quintic(), [], None, r"parameters must have shape \(n,\)"),
        (Quintic(), [0.0, np.nan], None, "parameters must be finite"),
        (Line(start=(0,), end=(1,)), [0.0], None, "2 or 3 axes, this contour has 1"),
        (Quintic(), [0.0], (1.0, 0.0), "normal must be finite and have 3"),
        (Quintic(), [0.0], (2.0, 0.0, 0.0), "must not be along the tangent"),
    ],
)
def test_mistakes_are_named(contour, parameters, normal, message):
    with pytest.raises(GeometryError, match=message):
        rotation_minimising_frames(contour, parameters, normal)
