"""Whatever a log holds, an evaluation or an error of ours comes out."""

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import contourlab as cl
from contourlab.errors import ContourlabError
from contourlab.logs import Log


@settings(max_examples=40, deadline=None)
@given(
    n=st.integers(2, 400),
    seed=st.integers(0, 2**32 - 1),
    n_axes=st.integers(2, 3),
    kind=st.sampled_from(["walk", "still", "steps", "jumps", "line", "equal", "huge", "tiny"]),
    grid=st.sampled_from([0.0, 1e-3]),
    holes=st.booleans(),
    timed=st.booleans(),
)
def test_evaluate(n, seed, n_axes, kind, grid, holes, timed):
    rng = np.random.default_rng(seed)
    commanded = np.cumsum(rng.normal(size=(n, n_axes)) * 1e-4, axis=0)
    if kind == "still":
        commanded[:, 1:] = 0.0
    elif kind == "steps":
        commanded = np.repeat(commanded[::7], 7, axis=0)[:n]
    elif kind == "jumps":
        commanded[rng.random(n) < 0.1] = 0.0
    elif kind == "line":
        commanded = np.linspace(0.0, 0.1, n)[:, None] * np.ones(n_axes)
    actual = commanded + rng.normal(size=(n, n_axes)) * 1e-6
    if kind == "equal":
        actual = commanded.copy()
    factor = {"huge": 1e8, "tiny": 1e-10}.get(kind, 1.0)
    commanded, actual = commanded * factor, actual * factor
    if grid:
        commanded, actual = np.round(commanded / grid) * grid, np.round(actual / grid) * grid
    steps = np.ones(n)
    if holes:
        steps += rng.integers(0, 3, n)
    time = np.cumsum(steps) * (1e-3 if timed else 1.0)
    log = Log(
        source="log", format="text", axes=("X", "Y", "Z")[:n_axes], time=time - time[0],
        sample_time=1e-3 if timed else 1.0, timed=timed, commanded=commanded, actual=actual,
        scale=1e-3, row=np.arange(n),
    )  # fmt: skip
    try:
        found = cl.evaluate(log)
    except ContourlabError:
        return
    for value in found.metrics.values():
        assert np.isfinite(value).all()
    shares = [c.share for c in found.causes if np.isfinite(c.share)]
    if shares and found.metrics["contour_error_rms"] > 0.0:
        np.testing.assert_allclose(sum(shares), 1.0, atol=1e-6)
    # what may not be changed is not changed
    assert dataclasses.is_dataclass(found)
