"""Where a search that ends too early, or goes on too far, gives another foot point."""

import jax
import jax.numpy as jnp
import numpy as np
from numpy.testing import assert_allclose

from contourlab.contours import Arc, Path, foot_point, local_foot
from contourlab.contours.foot_points import cells_of


def test_an_arc_leaves_the_ball_by_its_distance_from_the_plane_too():
    """Up a line to the plane of an arc, whose far side is out of the ball only by the height."""
    line = Path.polyline([[0.0, 0.0, -3.0], [0.0, 0.0, 0.0]])
    arc = Arc(
        center=(1.0, 0.0, 0.0), start=(0.0, 0.0, 0.0), angle=np.deg2rad(350), normal=(0, 0, 1)
    )
    path = Path.join([line, Path.from_contour(arc, 1e-9)])
    reference, beyond = np.array([0.0, 0.0, -1.5]), np.array([0.5, np.sqrt(0.75), 0.0])
    q = reference + 1.2 * (beyond - reference) / np.linalg.norm(beyond - reference)
    # twice the error is 2.4; the far side is 2 away in the plane, and 2.5 with the height of 1.5
    foot = foot_point(path, q[None], near=[1.5])
    assert_allclose(foot.position, [[0.0, 0.0, q[2]]], atol=1e-14)
    everywhere = foot_point(path, q[None])
    assert everywhere.distance[0] < foot.distance[0] - 0.05  # beyond the far side it is nearer
    traced = jax.jit(local_foot)(cells_of(path), jnp.asarray(q), 1.5)
    assert_allclose(traced.position, [0.0, 0.0, q[2]], atol=1e-14)


def test_many_short_pieces_do_not_hide_the_end_of_a_long_one():
    """The middles of twenty tiny pieces are nearer than that of the fragment whose end is."""
    k = np.arange(21)
    tiny = np.stack([5e-5 + 1e-7 * k, -6e-5 + 1e-7 * (k % 2)], axis=1)
    path = Path.polyline(np.concatenate([[[-1.0, 0.0], [0.0, 0.0], [1e-3, 0.0]], tiny]))
    q = np.array([[0.0, -1e-5]])
    assert np.linalg.norm(tiny - q, axis=1).max() < 1e-4  # a fragment of the line is 2.4e-4 long
    foot = foot_point(path, q)
    assert_allclose(foot.position, [[0.0, 0.0]], atol=1e-15)
