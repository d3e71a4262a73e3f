"""Predictive control by brute force: the equation simulated, its past noise found, J minimised.

Nothing of the package is used. The future is affine in the free commands, so J is minimised by
simulating every one of them alone and solving the least squares problem that is left.
"""

import numpy as np


def rational(numerator, denominator, signal):
    """Filter a whole record from rest."""
    out = np.zeros(len(signal))
    for k in range(len(signal)):
        value = sum(c * signal[k - j] for j, c in enumerate(numerator) if k >= j)
        value -= sum(c * out[k - j] for j, c in enumerate(denominator) if 0 < j <= k)
        out[k] = value / denominator[0]
    return out


class Axis:
    """One axis: A, B with its delay in front, C, D, P, Qn, Qd, φ, and its past from rest."""

    def __init__(self, a, b, c, d, p, qn, qd, phi, commands, outputs):
        self.a, self.b, self.c, self.d = a, b, c, d
        self.p, self.qn, self.qd, self.rule = p, qn, qd, np.convolve(phi, p)
        self.commands, self.outputs = np.asarray(commands), np.asarray(outputs)
        plain = rational(self.b, self.a, np.append(0.0, self.commands))
        self.noise = rational(self.d, self.c, self.outputs - plain)  # y - B/A u = C/D e

    def future(self, free, last, n_commands):
        """Return P y(k+1..k+last) and u*(k..k+n_commands-1) for given free commands."""
        past, u = self.commands, list(free)
        while len(u) < last:  # φ P u = 0
            tail = self.rule[1:]
            whole = np.concatenate([np.zeros(len(tail)), past, u])  # at rest before
            u.append(-sum(c * whole[-1 - j] for j, c in enumerate(tail)) / self.rule[0])
        whole = np.append(past, u)
        noise = np.append(self.noise, np.zeros(last))  # what is to come is not known
        y = rational(self.b, self.a, np.append(0.0, whole)) + rational(self.c, self.d, noise)
        k = len(self.outputs)
        weighted = rational(self.qn, self.qd, whole)
        py = rational(self.p, [1.0], y)
        return py[k:], weighted[k - 1 : k - 1 + n_commands]


def minimise(axes, reference, tangents, weights, horizons, delay, held=0.0):
    """Return the free commands that minimise (10), beyond the held ones, shape (n_axes, n_free).

    ``reference`` is w(k+1..k+last), ``tangents`` t(k..k+last), ``weights`` (ρ_cn, ρ_ct, ρ_n, ρ_t),
    ``horizons`` (first, last, free). Positions and commands count from rest at 0, where
    the commands, filtered, are ``held``.
    """
    first, last, n_free = horizons
    cn, ct, rn, rt = weights
    n, n_commands = len(axes), last - delay

    def residuals(free):
        both = [axis.future(u, last, n_commands) for axis, u in zip(axes, free, strict=True)]
        e = np.stack(
            [np.sum(a.p) * w - y for a, (y, _), w in zip(axes, both, reference.T, strict=True)], 1
        )
        star = np.stack([u for _, u in both], 1) + held
        rows = []
        for j in range(first, last + 1):
            rows += split(e[j - 1], tangents[j], cn, ct)
        for j in range(1, n_commands + 1):
            rows += split(star[j - 1], tangents[j - 1], rn, rt)
        return np.array(rows)

    zero = np.zeros((n, n_free))
    rest = residuals(zero)
    columns = []
    for k in range(zero.size):
        one = zero.copy()
        one.flat[k] = 1.0
        columns.append(residuals(one) - rest)
    return np.linalg.lstsq(np.stack(columns, 1), -rest, rcond=None)[0].reshape(n, n_free)


def split(vector, tangent, across, along):
    """Return the weighted parts along and across a direction; all is across where there is none."""
    e_t = tangent @ vector
    return [np.sqrt(along) * e_t, *(np.sqrt(across) * (vector - e_t * tangent))]
