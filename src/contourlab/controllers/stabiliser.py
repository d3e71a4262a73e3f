"""Gains that stabilise an axis behind its internal model, by linear matrix inequalities.

What the internal model leaves of the axis is S(z) e = B(z) u_st (34),

    x(k+1) = A(k) x(k) + b u_st(k),   A = [-α1(k) 1 . ; -α2(k) . 1 ; ...],   e = x_1,

of order n. α moves within a box about (-2, 1), which is where a path sampled finely has it; A is
affine in α, so that the four corners of the box span it (38). The gain K is scheduled over α1,
which is known in time, between one gain at its lower and one at its upper end, with weights that
are convex: σ = (α1 - low) / (high - low), clipped to 0 ... 1. α2(k) is known one sample too late
and is taken for uncertain. With corners i = (α1, α2), one G and R for each end of α1, and ρ the
decay,

    [ G_i + G_i' - Q_i      (A_i G_i + b R_i)' ]
    [ A_i G_i + b R_i              ρ² Q_j      ]  > 0   for all corners i, j,           (40)

K = R G⁻¹ at each end (41): the size x' Q⁻¹ x of the state then falls by ρ² or more a sample,
however α moves within the box.

The inequalities say what is enough, not one answer: gains depend on what the solver is asked for
beside them. In the middle of all answers, with the widest margin, is a gain that is nearly
dead-beat, whatever ρ is. The *least gain* for ρ has the least W with

    [ W     R_i              ]
    [ R_i'  G_i + G_i' - Q_i ]  > 0,    Q_i > I,    so that K K' <= K Q_i K' <= W.          (1)

The certificate is what counts. It is verified here, with the numbers as they came
out, and reported with the box that it holds for. Outside the box, in the one or two samples about a
singular instant of the exosystem, nothing is proved.

The solver is Clarabel by CVXPY: ``pip install contourlab[design]``. The axis is scaled by b_1.

References
----------
.. [CaoZhang] (34) to (41), Proposition 5.1, Lemma 5.3.
.. [DaafouzBernussou2001] Theorems 3 and 4, as cited there; the paper was not at hand.

Differences from the paper
--------------------------
Convex weights: those of (39), Lagrange's, are not for three points or more. The box in α: A is no
function of y1 alone. The decay, and the least gain for it.
"""

from __future__ import annotations

import itertools
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import ConfigurationError, RefusedError

__all__ = [
    "CENTRE",
    "StabiliserDesign",
    "certified_half_width",
    "closed_loop",
    "design_stabiliser",
    "falling_margin",
]

CENTRE = np.array([-2.0, 1.0])
"""α of a straight line, about which that of every finely sampled path lies."""
WITHIN = 0.999
"""Share of ρ that the solver is asked for."""


@dataclass(frozen=True, eq=False)
class StabiliserDesign:
    """Gains and their certificate for one axis."""

    gain: NDArray[Any]
    """K at the lower and the upper end of α1, shape (2, n) [command unit per m]."""
    low: float
    """Lower end of α1."""
    high: float
    """Upper end of α1."""
    half_width: float
    """Of the box: |α1 + 2| and |α2 - 1| up to this."""
    decay: float
    """ρ: bound on what is left of the state after a sample, in the certificate's own size."""
    lyapunov: NDArray[Any]
    """Q at the four corners, shape (2, 2, n, n), in states divided by b_1."""
    margin: float
    """Least eigenvalue of the inequalities ρ² Q_i⁻¹ - A_i' Q_j⁻¹ A_i, relative to the largest of
    Q⁻¹: positive, or there is no certificate."""


def closed_loop(alpha: Any, numerator: Any, gain: Any) -> NDArray[Any]:
    """Return A + b K in states divided by b_1, shape (n, n).

    Parameters
    ----------
    alpha
        (α1, α2).
    numerator
        b, shape (n,).
    gain
        K, shape (n,) [command unit per m].
    """
    b = np.asarray(numerator, float)
    scaled = b / b[0]
    matrix = np.eye(len(b), k=1) + np.outer(scaled, np.asarray(gain, float) * b[0])
    matrix[:2, 0] -= np.asarray(alpha, float)
    return matrix


def design_stabiliser(
    numerator: Any, *, half_width: float = 0.01, decay: float = 0.6, least_gain: bool = False
) -> StabiliserDesign:
    """Return gains with a certificate.

    Parameters
    ----------
    numerator
        b of the axis, shape (n,) [m per unit of command]; zeros inside the unit circle.
    half_width
        Of the box of α about (-2, 1), > 0.
    decay
        ρ, 0 to 1.
    least_gain
        Whether the least gain for ρ is taken, by (1), and not the one in the middle.

    Raises
    ------
    ConfigurationError
        CVXPY with Clarabel is not installed; a value out of bounds.
    RefusedError
        There is no such gain, or the solver's answer does not stand the check.
    """
    if not half_width > 0.0:
        raise ConfigurationError(f"half_width must be > 0, got {half_width:g}")
    if not 0.0 < decay < 1.0:
        raise ConfigurationError(f"decay must be > 0 and < 1, got {decay:g}")
    cp = _cvxpy()
    b = np.asarray(numerator, float)
    n, scaled = len(b), b / b[0]
    ends = (-1.0, 1.0)
    corners = {
        (i, j): CENTRE + half_width * np.array([ends[i], ends[j]])
        for i, j in itertools.product((0, 1), repeat=2)
    }
    q = {corner: cp.Variable((n, n), symmetric=True) for corner in corners}
    g = [cp.Variable((n, n)) for _ in ends]
    r = [cp.Variable((1, n)) for _ in ends]
    slack, effort = cp.Variable(), cp.Variable((1, 1))
    sizes = {c: g[c[0]] + g[c[0]].T - q[c] for c in corners}
    # the least gain lies at the edge: a little more is asked of the solver than is checked
    asked = WITHIN * decay if least_gain else decay
    constraints = []
    for corner, other in itertools.product(corners, repeat=2):
        open_loop = closed_loop(corners[corner], b, np.zeros(n))
        moved = open_loop @ g[corner[0]] + scaled[:, None] @ r[corner[0]]
        block = cp.bmat([[sizes[corner], moved.T], [moved, asked**2 * q[other]]])
        edge = 0 if least_gain else slack * np.eye(2 * n)
        constraints.append(0.5 * (block + block.T) >> edge)  # (40)
    if least_gain:
        constraints += [one >> np.eye(n) for one in q.values()]
        for corner, size in sizes.items():
            block = cp.bmat([[effort, r[corner[0]]], [r[corner[0]].T, size]])
            constraints.append(0.5 * (block + block.T) >> 0)  # (1)
        problem = cp.Problem(cp.Minimize(effort[0, 0]), constraints)
    else:
        constraints.append(sum(cp.trace(one) for one in q.values()) == 4.0 * n)
        problem = cp.Problem(cp.Maximize(slack), constraints)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an inaccurate answer is found out by the check
            problem.solve(solver=cp.CLARABEL)
    except cp.error.SolverError as error:
        raise RefusedError(
            f"the solver of the stabiliser's inequalities failed: {error}"
        ) from error
    found = effort.value is not None if least_gain else (slack.value or -1.0) > 0.0
    if not found:
        raise RefusedError(
            f"no gain is certified for exosystem coefficients within {half_width:g} of (-2, 1) and "
            f"a decay of {decay:g}: take a smaller stabiliser_range or a decay nearer to 1"
        )
    gains = np.array([(np.linalg.solve(g[i].value.T, r[i].value[0])) / b[0] for i in (0, 1)])
    inverse = {corner: np.linalg.inv(value.value) for corner, value in q.items()}
    margin = min(
        falling_margin(closed_loop(corners[c], b, gains[c[0]]), inverse[c], inverse[o], decay)
        for c, o in itertools.product(corners, repeat=2)
    )
    if not margin > 0.0:
        raise RefusedError(
            f"the solver's answer does not stand the check of its certificate (margin {margin:.3g})"
        )
    table = np.array([[q[i, j].value for j in (0, 1)] for i in (0, 1)])
    low, high = CENTRE[0] - half_width, CENTRE[0] + half_width
    return StabiliserDesign(gains, low, high, half_width, decay, table, margin)


def certified_half_width(
    numerator: Any, gain: Any, *, decay: float = 1.0, digits: int = 12
) -> float:
    """Return the largest box about (-2, 1) in which one quadratic form certifies a constant gain.

    Found by halving: every size that is reported has been solved for and checked.

    Parameters
    ----------
    numerator
        b of the axis, shape (n,).
    gain
        K, shape (n,) [command unit per m].
    decay
        ρ, 0 to 1; 1 asks for no more than that the state falls.
    digits
        Halvings of the interval 0 to 2.

    Raises
    ------
    ConfigurationError
        CVXPY with Clarabel is not installed.
    """
    low, high = 0.0, 2.0
    for _ in range(digits):
        middle = 0.5 * (low + high)
        if _common(numerator, gain, middle, decay):
            low = middle
        else:
            high = middle
    return low


def _common(numerator: Any, gain: Any, half_width: float, decay: float) -> bool:
    cp = _cvxpy()
    n = len(np.asarray(numerator))
    loops = [
        closed_loop(CENTRE + half_width * np.array(signs), numerator, gain)
        for signs in itertools.product((-1.0, 1.0), repeat=2)
    ]
    p = cp.Variable((n, n), symmetric=True)
    slack = cp.Variable()
    falls = [decay**2 * p - loop.T @ p @ loop >> slack * np.eye(n) for loop in loops]
    problem = cp.Problem(cp.Maximize(slack), [p >> slack * np.eye(n), cp.trace(p) == n, *falls])
    try:
        problem.solve(solver=cp.CLARABEL)
    except cp.error.SolverError:
        return False
    if p.value is None:
        return False
    return all(falling_margin(loop, p.value, p.value, decay) > 0.0 for loop in loops)


def falling_margin(
    loop: NDArray[Any], now: NDArray[Any], later: NDArray[Any], decay: float
) -> float:
    """Return the least eigenvalue of ρ² P_i - A' P_j A and of P_j, relative to the largest of P.

    Positive: the size x' P x of the state falls by ρ² in this sample, and is a size.

    Parameters
    ----------
    loop
        A, shape (n, n).
    now, later
        P_i and P_j, shape (n, n).
    decay
        ρ.
    """
    falls = decay**2 * now - loop.T @ later @ loop
    sizes = np.linalg.eigvalsh(0.5 * (later + later.T))
    least = min(float(np.linalg.eigvalsh(0.5 * (falls + falls.T))[0]), float(sizes[0]))
    return least / float(sizes[-1])


def _cvxpy() -> Any:
    try:
        import cvxpy
    except ImportError as error:
        raise ConfigurationError(
            "the stabiliser's gains are found by CVXPY with Clarabel, which is not installed: "
            "pip install contourlab[design], or give stabiliser_gain"
        ) from error
    return cvxpy
