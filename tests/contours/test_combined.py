"""A tool moved by more axes than it has coordinates."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours import Lissajous, combined
from contourlab.errors import GeometryError
from contourlab.testing.contours import check_contour

MATRIX = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]])


def four_axes():
    return Lissajous(
        amplitudes=np.array([1.0, 1.0, 0.1, 0.1]), frequencies=(1.0, 1.0, 10.0, 10.0),
        phases=np.array([0.5 * np.pi, 0.0, 0.5 * np.pi, 0.0]),
    )  # fmt: skip


def test_the_tool_is_stage_less_scanner():
    t = 0.7
    rows = np.asarray(combined(four_axes(), MATRIX).derivatives(t, 2))
    point = [np.cos(t) - 0.1 * np.cos(10 * t), np.sin(t) - 0.1 * np.sin(10 * t)]
    slope = [-np.sin(t) + np.sin(10 * t), np.cos(t) - np.cos(10 * t)]
    bend = [-np.cos(t) + 10 * np.cos(10 * t), -np.sin(t) + 10 * np.sin(10 * t)]
    assert_allclose(rows, [point, slope, bend], atol=1e-13)


@pytest.mark.slow
def test_conformance():
    check_contour(combined(four_axes(), [[1.0, 0, -0.5, 0], [0, 1.0, 0, -0.5]]))


def test_a_matrix_for_other_axes_is_refused():
    with pytest.raises(GeometryError, match="one column for each of the 4 axes"):
        combined(four_axes(), MATRIX[:, :3])
