"""An independent judge of nearest distances: dense sampling and golden sections, in NumPy alone.

It knows nothing but the curve's points. Every sampled minimum that could be the least, by how far
the curve moves between two samples, is resampled and then narrowed by golden sections. Distances
are right to rounding where the curve has no feature narrower than a sample.
"""

from itertools import pairwise

import numpy as np

SAMPLES = 8001
FINER = 33
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def least(curve, breaks, q, samples=SAMPLES, inside=None):
    """Return the least distance from points to a curve.

    curve: from parameters, shape (n,), to points, shape (n, n_axes). breaks: parameters between
    which it is smooth. q: shape (m, n_axes). inside: of each point the samples that count.
    """
    t = np.unique(np.concatenate([
        np.linspace(a, b, max(int(samples * (b - a) / (breaks[-1] - breaks[0])), 9))
        for a, b in pairwise(breaks)
    ]))  # fmt: skip
    r = curve(t)
    moved = 1.5 * np.max(np.linalg.norm(np.diff(r, axis=0), axis=1))
    result = np.empty(len(q))
    for k, point in enumerate(q):
        d = np.linalg.norm(r - point, axis=1)
        if inside is not None:
            d = np.where(inside(k, t, r), d, np.inf)
        padded = np.concatenate([[np.inf], d, [np.inf]])
        low = (d <= padded[:-2]) & (d <= padded[2:]) & (d - moved <= d.min())
        centre = np.flatnonzero(low)
        centre = centre[np.argsort(d[centre])][:400]
        a, b = t[np.maximum(centre - 1, 0)], t[np.minimum(centre + 1, len(t) - 1)]
        best = d.min()
        # finer looks on each side, so that two minima between two samples are seen
        fine = a[:, None] + (b - a)[:, None] * np.linspace(0.0, 1.0, FINER)
        away = np.linalg.norm(curve(fine.reshape(-1)) - point, axis=1).reshape(fine.shape)
        best = min(best, away.min())
        padded = np.pad(away, ((0, 0), (1, 1)), constant_values=np.inf)
        row, column = np.nonzero((away <= padded[:, :-2]) & (away <= padded[:, 2:]))
        a = fine[row, np.maximum(column - 1, 0)]
        b = fine[row, np.minimum(column + 1, FINER - 1)]
        for _ in range(75):
            x, y = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
            left = np.linalg.norm(curve(x) - point, axis=1)
            right = np.linalg.norm(curve(y) - point, axis=1)
            best = min(best, left.min(), right.min())
            nearer = left < right
            a, b = np.where(nearer, a, x), np.where(nearer, y, b)
        result[k] = best
    return result


def connected(centre_index, reach, closed):
    """Return a function for ``least``: samples on the stretch around one, within a reach.

    centre_index: from the samples' parameters, the place of each point's reference. Walks both
    ways until the curve is further than ``reach`` from the reference point.
    """

    def inside(k, t, r):
        at, centre = centre_index(k, t)
        out = np.linalg.norm(r - centre, axis=1) > reach[k]
        if not out.any():
            return np.ones(len(t), bool)
        mask = np.zeros(len(t), bool)
        n = len(t)
        ahead = np.concatenate([np.arange(at, n), np.arange(at) if closed else []]).astype(int)
        behind = np.concatenate(
            [np.arange(at - 1, -1, -1), np.arange(n - 1, at - 1, -1) if closed else []]
        ).astype(int)
        for way in (ahead, behind):
            first = np.argmax(out[way]) if out[way].any() else len(way)
            mask[way[:first]] = True
        return mask

    return inside
