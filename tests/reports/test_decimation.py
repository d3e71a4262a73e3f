from __future__ import annotations

import numpy as np
import pytest

from contourlab.reports.decimation import kept_rows, shape_rows, spans


@pytest.mark.parametrize(("n", "budget"), [(1, 10), (10, 10), (11, 10), (1000, 50), (100_003, 997)])
def test_kept_rows_hold_the_ends_and_every_extreme_within_the_budget(n, budget):
    series = [np.random.default_rng(k).normal(size=n) for k in range(2)]
    rows = kept_rows(n, budget, series)
    assert len(rows) <= budget
    assert rows[0] == 0
    assert rows[-1] == n - 1
    assert (np.diff(rows) > 0).all() if n > 1 else True
    for values in series:
        assert values.argmax() in rows
        assert values.argmin() in rows


def test_nan_does_not_hide_an_extreme():
    values = np.zeros(5000)
    values[100:200] = np.nan
    values[150] = 3.0
    assert 150 in kept_rows(5000, 100, [values])


def test_shape_rows_keep_sharp_corners():
    corner = 7321
    along = np.arange(20_001.0)
    points = np.stack([np.minimum(along, corner), np.maximum(along - corner, 0.0)], axis=1)
    rows = shape_rows(points, 200)
    assert len(rows) <= 201
    assert corner in rows


def test_spans_join_what_is_closer_than_the_gap():
    flags = np.zeros(100, bool)
    flags[[3, 4, 5, 9, 40]] = True
    assert spans(flags, 1) == [(3, 5), (9, 9), (40, 40)]
    assert spans(flags, 4) == [(3, 9), (40, 40)]
    assert spans(np.zeros(10, bool), 1) == []
