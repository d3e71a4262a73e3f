"""Contours of any kind as one path: exact where they can be, measured where not, gaps refused."""

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.base import Contour
from contourlab.contours.bspline import BSpline
from contourlab.contours.circle import Arc
from contourlab.contours.joining import join
from contourlab.contours.line import Line
from contourlab.contours.path import Path
from contourlab.errors import GeometryError

LINE = Line(start=(0.0, 0.0), end=(1.0, 0.0))
ARC = Arc(center=(1.0, 1.0), start=(1.0, 0.0), angle=np.pi)
SPLINE = BSpline(control_points=[[1, 2], [0, 2], [-0.5, 1], [-0.5, 0.5], [0, 0]])


class Wave(Contour):
    """y = sin(x) / 10 from 0 to 2π, which no path can hold exactly."""

    @property
    def n_axes(self):
        return 2

    @property
    def domain(self):
        return 0.0, 2.0 * np.pi

    @property
    def closed(self):
        return False

    def position(self, parameter, piece=None):
        return jax.numpy.stack([parameter, 0.1 * jax.numpy.sin(parameter)])


def test_rows_stay_exact():
    joined = join([LINE, ARC, SPLINE], closed=True)
    assert joined.path.closed
    assert_allclose(joined.path.length, 1.0 + np.pi + float(SPLINE.length), rtol=1e-12)
    assert list(joined.reached) == [0.0, 0.0, 0.0]
    assert list(joined.first_piece) == [0, 1, 2]
    assert joined.path.kinds == "mixed"
    assert_allclose(joined.path.curvature[:2], [0.0, 1.0], rtol=1e-15)
    assert_allclose(joined.gaps, 0.0, atol=1e-15)
    rows = joined.path.piece(2)
    assert_allclose(rows.control_points[0, 0, :2], [1, 2], rtol=0, atol=1e-15)


def test_formulas_enter_within_the_tolerance_that_is_reported():
    before = Path.polyline([[-1.0, 0.0], [0.0, 0.0]])
    joined = join([before, Wave()], tolerance=1e-6)
    assert joined.reached[0] == 0.0
    assert 0.0 < joined.reached[1] <= 1e-6
    s = np.linspace(1.0, float(joined.path.length), 300)
    x, y = np.asarray(jax.jit(jax.vmap(joined.path.position))(s)).T
    # the distance from the curve is not more than the one along y
    assert np.abs(y - 0.1 * np.sin(x)).max() <= 1e-6
    assert Path.join([before, Wave()], tolerance=1e-6).n_pieces == joined.path.n_pieces


@pytest.mark.parametrize(
    ("contours", "options", "message"),
    [
        ([LINE, SPLINE], {}, r"contour 0 \(Line\) ends at \(1, 0\) m, 2 m away from the start of "
         r"contour 1 \(BSpline\) at \(1, 2\) m; ends must meet within 2e-09 m"),
        ([LINE, ARC], {"closed": True}, r"contour 1 \(Arc\) ends .* start of contour 0"),
        ([LINE, Wave()], {}, r"contour 1 \(Wave\) enters .* tolerance is missing"),
        ([Wave()], {"tolerance": 0.0}, "tolerance must be > 0 m"),
        ([LINE, Line(start=(1.0, 0.0, 0.0), end=(1.0, 1.0, 1.0))], {}, "has 3 axes, but"),
        ([], {}, "one contour or more"),
    ],
)  # fmt: skip
def test_what_cannot_be_joined_is_named(contours, options, message):
    with pytest.raises(GeometryError, match=message):
        join(contours, **options)
