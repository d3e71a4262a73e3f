"""What will become of the outputs: the predictor of unified predictive control, axis by axis.

Every axis is, with q⁻¹ the delay of one sample and the delay d kept in B,

    y(k) = (B / A) u(k-1) + (C / D) e(k)                                                  (6)

with e an unknown sequence of pulses; D is the paper's T: it says which disturbances come back for
ever and are therefore to be predicted and removed. Long division with i terms of the quotient,

    P B / A = G_i + q^-i H_i / A     (16)         P C / D = E_i + q^-i F_i / D       (8), (17)
    Q_n / Q_d = Φ_i + q^-i Ω_i / Q_d (18)

splits into what future commands do and what is settled. Two forms give the same numbers where both
exist:

*independent*, as printed: the model runs beside the machine, y_m = (B/A) u(k-1), and

    P y(k+i) = G_i u(k+i-1) + H_i u(k-1)/A + F_i (y(k) - y_m(k)) / C.                       (7)

On an axis that integrates, y_m runs away from y under any constant disturbance and u/A grows
without bound. For short runs, and for D without A.

*realigned*: D = A D', and y_m is eliminated,

    P y(k+i) = G_i u(k+i-1) + H'_i u(k-1)/C + F_i y(k)/C,   H'_i = (C H_i - F_i B) / A,

the division leaving no remainder. Nothing grows. With C = 1 this is generalised predictive control.

Positions count from the start of the run and commands from the one that holds the machine there.

A position that is not finite is replaced by the one that (6) expects of what came before, with
e(k) = 0: the model goes on by itself, and whatever D lists goes on with it. The next position that
is measured counts as always.

References
----------
.. [ElKhalickUchiyama] equations (6) to (9) and (14) to (20).

Differences from the paper
--------------------------
(8) and (18) print q⁻¹ for q^-i; (16) leaves out P and uses H, F of other equations' names; (17) is
(8) for C = 1, D = A. Past commands enter as a vector, where (20) prints one number, filtered
by 1/A; y - y_m is filtered by 1/C where (20) prints 1/T. N stands with past commands,
not with filtered ones.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.controllers.polynomials import divide, multiply, padded
from contourlab.typing import Array, AxisVector, Matrix

__all__ = ["History", "Horizons", "Polynomials", "Predictor", "make_predictor"]

HOLDS_NOTHING = 1e-12
"""Share of its coefficients below which A(1) is 0: the axis stays where it is without a command."""


class Horizons(NamedTuple):
    """Numbers of samples; all static."""

    first: int
    """H_m, first output that counts."""
    last: int
    """H_p, last output that counts."""
    free: int
    """H_c, commands that are free."""
    commands: int
    """H_p - d, commands that reach an output within the horizon."""


class Polynomials(NamedTuple):
    """Coefficients per axis, shapes (n_axes, ...)."""

    numerator: Array
    """B, the delay in front."""
    denominator: Array
    """A."""
    noise: Array
    """C."""
    disturbance: Array
    """D; in the realigned form D' of D = A D'."""
    servo: Array
    """P."""
    filter_numerator: Array
    """Q_n."""
    filter_denominator: Array
    """Q_d."""
    holding: Array
    """φ, which with P says how commands go on after the free ones."""


class History(NamedTuple):
    """What the predictor remembers, the newest first."""

    origin: AxisVector
    """Where the run began [m]."""
    inputs: Matrix
    """u/A or u/C."""
    outputs: Matrix
    """(y - y_m)/C or y/C."""
    weighted: Matrix
    """u/Q_d."""
    commands: Matrix
    """u."""


class Predictor(eqx.Module):
    """The matrices of one axis set, and the filters that feed them."""

    reach: Float[Array, "n_axes n_outputs n_free"]
    """G M."""
    settled: Float[Array, "n_axes n_outputs n_past"]
    """[H, F, G N]."""
    effort: Float[Array, "n_axes n_commands n_free"]
    """Φ M."""
    settled_effort: Float[Array, "n_axes n_commands n_past_commands"]
    """[Ω, Φ N]."""
    target: AxisVector
    """P(1)."""
    at_rest: AxisVector
    """Command that holds the machine per distance [command unit per m]."""
    effort_at_rest: AxisVector
    """The same, filtered by Q(1)."""
    input_filter: Float[Array, "n_axes n_inputs"]
    """A or C after its 1, as the next two: by what past values are filtered."""
    output_filter: Float[Array, "n_axes n_past_outputs"]
    """C."""
    weight_filter: Float[Array, "n_axes n_weighted"]
    """Q_d."""
    own_output: Float[Array, "n_axes n_inputs"] | None
    """B of the model that runs beside; None in the realigned form."""
    expected_by_inputs: Float[Array, "n_axes n_inputs"]
    """What the past makes of the next filtered output if e = 0, by past inputs."""
    expected_by_outputs: Float[Array, "n_axes n_past_outputs"]
    """And by past outputs."""

    def start(self, position: AxisVector) -> History:
        """Return the history of a machine that has been at rest.

        Parameters
        ----------
        position
            Where, shape (n_axes,) [m].
        """
        n = int(position.shape[0])
        n_inputs, n_outputs = int(self.input_filter.shape[1]), int(self.output_filter.shape[1])
        n_weighted = int(self.weight_filter.shape[1])
        n_commands = int(self.settled_effort.shape[2]) - n_weighted
        return History(
            jnp.asarray(position), jnp.zeros((n, n_inputs)), jnp.zeros((n, n_outputs)),
            jnp.zeros((n, n_weighted)), jnp.zeros((n, n_commands)),
        )  # fmt: skip

    def measured(self, history: History, position: AxisVector) -> tuple[History, AxisVector]:
        """Return the history with what has been measured now, and the position it goes by.

        Parameters
        ----------
        history
            As ``start`` or ``applied`` returned it.
        position
            Measured, shape (n_axes,) [m]; where it is not finite, the expected one is taken.
        """
        known = jnp.isfinite(position)
        y = jnp.where(known, position, history.origin) - history.origin
        before = jnp.sum(self.output_filter * history.outputs, -1)
        beside = jnp.zeros_like(y)
        if self.own_output is not None:
            beside = jnp.sum(self.own_output * history.inputs, -1)
        expected = jnp.sum(self.expected_by_inputs * history.inputs, -1)
        expected = expected + jnp.sum(self.expected_by_outputs * history.outputs, -1)
        new = jnp.where(known, y - beside - before, expected)
        outputs = jnp.concatenate([new[:, None], history.outputs[:, :-1]], 1)
        taken = jnp.where(known, position, history.origin + beside + before + expected)
        return history._replace(outputs=outputs), taken

    def applied(self, history: History, command: AxisVector) -> History:
        """Return the history with what the drives were given, after every limit.

        Parameters
        ----------
        history
            As ``measured`` returned it.
        command
            Shape (n_axes,).
        """
        u = command - self.at_rest * history.origin
        return history._replace(
            inputs=_filtered(self.input_filter, history.inputs, u),
            weighted=_filtered(self.weight_filter, history.weighted, u),
            commands=jnp.concatenate([u[:, None], history.commands[:, :-1]], 1),
        )

    def residual(
        self, history: History, reference: Float[Array, "n_outputs n_axes"]
    ) -> Float[jax.Array, "n_axes n_outputs"]:
        """Return P y - P(1) w over the horizon if every free command is the holding one.

        Parameters
        ----------
        history
            As ``measured`` returned it.
        reference
            w(k+H_m) to w(k+H_p) [m].
        """
        past = jnp.concatenate([history.inputs, history.outputs, history.commands], 1)
        target = self.target[:, None] * (reference - history.origin).T
        return jnp.sum(self.settled * past[:, None, :], -1) - target

    def residual_effort(self, history: History) -> Float[jax.Array, "n_axes n_commands"]:
        """Return the filtered commands u* if every free command is the holding one.

        Parameters
        ----------
        history
            As ``measured`` returned it.
        """
        past = jnp.concatenate([history.weighted, history.commands], 1)
        rest = (self.effort_at_rest * history.origin)[:, None]
        return jnp.sum(self.settled_effort * past[:, None, :], -1) + rest


def _filtered(tail: Matrix, past: Matrix, value: AxisVector) -> Array:
    """Return the past of a filter 1 / (1 + tail q⁻¹) with one value more."""
    new = value - jnp.sum(tail * past, -1)
    return jnp.concatenate([new[:, None], past[:, :-1]], 1)


@functools.partial(jax.jit, static_argnames=("horizons", "realigned"))
def make_predictor(
    polynomials: Polynomials, *, horizons: Horizons, realigned: bool
) -> Predictor:  # fmt: skip
    """Return the predictor of an axis set.

    Parameters
    ----------
    polynomials
        Of every axis.
    horizons
        Numbers of samples.
    realigned
        Whether in the realigned form; D is then A times what is given.
    """
    p = polynomials
    b, a = p.numerator / p.denominator[:, :1], p.denominator / p.denominator[:, :1]
    c = p.noise / p.noise[:, :1]
    d = p.disturbance / p.disturbance[:, :1]
    q_d = p.filter_denominator / p.filter_denominator[:, :1]
    q_n = p.filter_numerator / p.filter_denominator[:, :1]
    last = horizons.last
    steps, h = divide(multiply(p.servo, b), a, last)  # (16)
    _, f = divide(multiply(p.servo, c), multiply(a, d) if realigned else d, last)  # (8)
    n_inputs = max(b.shape[1], a.shape[1] - 1, 1)
    own_output: Array | None = b
    input_filter = a[:, 1:]
    # (D/C) (y - y_m) = e by past values, e = 0
    by_inputs: Array = jnp.zeros_like(b)
    by_outputs: Array = -d[:, 1:]
    if realigned:
        by_inputs, by_outputs = multiply(b, d), -multiply(a, d)[:, 1:]
        n_inputs = max(b.shape[1] + d.shape[1] - 2, c.shape[1] - 1, 1)
        above, below = multiply(c[:, None], h), multiply(f, b[:, None])
        length = max(above.shape[2], below.shape[2])
        h, _ = divide(padded(above, length) - padded(below, length), a[:, None], n_inputs)
        own_output, input_filter = None, c[:, 1:]
    n_inputs = max(n_inputs, h.shape[2], by_inputs.shape[1])
    n_outputs = max(f.shape[2], c.shape[1] - 1, 1)
    effects, omega = divide(q_n, q_d, horizons.commands)  # (18)
    n_weighted = int(omega.shape[2])
    free, bound = _held(multiply(p.holding, p.servo), horizons)  # M, N of (14)
    g = _toeplitz(steps, horizons.commands, last)[:, horizons.first - 1 :]
    phi = _toeplitz(effects, horizons.commands, horizons.commands)
    rows = slice(horizons.first - 1, last)
    return Predictor(
        reach=g @ free,
        settled=jnp.concatenate(
            [padded(h[:, rows], n_inputs), padded(f[:, rows], n_outputs), g @ bound], 2
        ),
        effort=phi @ free,
        settled_effort=jnp.concatenate([omega, phi @ bound], 2),
        target=jnp.sum(p.servo, 1),
        at_rest=_at_rest(a, b),
        effort_at_rest=_at_rest(a, b) * _at_rest(q_n, q_d),
        input_filter=padded(input_filter, n_inputs),
        output_filter=padded(c[:, 1:], n_outputs),
        weight_filter=padded(q_d[:, 1:], n_weighted),
        own_output=None if own_output is None else padded(own_output, n_inputs),
        expected_by_inputs=padded(by_inputs, n_inputs),
        expected_by_outputs=padded(by_outputs, n_outputs),
    )


def _at_rest(top: Array, bottom: Array) -> Array:
    """Return top(1) / bottom(1), 0 where either is 0 to rounding."""

    def sum_of(polynomial: Array) -> Array:
        total = jnp.sum(polynomial, 1)
        nothing = jnp.abs(total) <= HOLDS_NOTHING * jnp.sum(jnp.abs(polynomial), 1)
        return jnp.where(nothing, 0.0, total)

    above, below = sum_of(top), sum_of(bottom)
    return jnp.where(below == 0.0, 0.0, above / jnp.where(below == 0.0, 1.0, below))


def _toeplitz(values: Array, columns: int, rows: int) -> Array:
    """Return the matrix with values[i - j] in row i and column j, (n_axes, rows, columns)."""
    lag = jnp.arange(rows)[:, None] - jnp.arange(columns)
    return jnp.where(lag >= 0, values[:, jnp.maximum(lag, 0)], 0.0)


def _held(rule: Array, horizons: Horizons) -> tuple[Any, Any]:
    """Return M and N of u = M u_free + N u_past, from rule · u = 0 after the free commands (14)."""
    n, order = int(rule.shape[0]), int(rule.shape[1]) - 1
    n_free, n_past = horizons.free, max(order - horizons.free, 1)
    width = n_free + n_past
    tail = rule[:, 1:] / rule[:, :1]
    basis = jnp.eye(width)
    # the rows of u(k-1), u(k-2), ... by which the recursion begins
    before = [basis[n_free + k] if k < n_past else jnp.zeros(width) for k in range(max(order, 1))]
    window = jnp.broadcast_to(jnp.stack(before), (n, max(order, 1), width))
    rows = []
    for k in range(horizons.commands):
        row = jnp.broadcast_to(basis[k], (n, width))
        if k >= n_free:
            row = -jnp.sum(tail[:, :, None] * window[:, :order], 1)
        rows.append(row)
        window = jnp.concatenate([row[:, None], window[:, :-1]], 1)
    table = jnp.stack(rows, 1)
    return table[..., :n_free], table[..., n_free:]
