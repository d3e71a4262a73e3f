"""Contour error by Newton's method for the foot point: Ghaffari and Ulsoy's dynamic estimate.

The foot point of the actual point P is the parameter θ that minimises the cost; its estimate θ̂
follows Newton's law, in time or, here also, within each sample:

    J(θ̂) = |E|² / 2,   E(θ̂) = R(θ̂) - P                            (4)
    dθ̂/dt = -k' g / h                                             (8)
    g = E·R'                                                      (9)
    h = E·R'' + |R'|²                                             (10)
    h = |R'|²                                                     (11)

with primes on R derivatives over the parameter. Near the foot the error of θ̂ dies out at the rate
k' whatever the shape of the contour,

    d(θ̂ - θ*)/dt = -k' (θ̂ - θ*)                                   (13)

which holds with (10); with (11) the rate is k' (1 + E·R''/|R'|²) = k' (1 - δ/ρ), slower on the
inside of a curve of radius ρ by the distance δ from it.

``form`` says how the law is run:

``"converged"`` (the default)
    A fixed count of ``iterations`` within each sample, k' = 1 per iteration, from the foot of the
    sample before or from the reference parameter, whichever is nearer to P; the error is E(θ̂). A
    step that does not come nearer is taken back and tried at a quarter of its length. With (10)
    convergence is quadratic: the parameter's error is squared, times a few curvatures, with each
    iteration. Exact to rounding on a smooth contour once the foot moves by less than about a tenth
    of the radius of curvature between samples.

``"projected"``
    The law in time with the paper's filter; the error is the part of E across the tangent at θ̂,
    E - (E·U) U. On a foot that moves at the speed V_t along the contour, (8) is a loop of type 1:
    it follows V_t / k' behind, whatever the filter. By the projection that miss m enters as
    κ m² / 2 only: 0.08 µm for 20 mm/s, k' = 500 /s and a radius of 10 mm.

``"filtered"``
    The same, the error being E(θ̂) as the paper has it. The miss V_t / k' enters in full, along the
    tangent: 40 µm in that example, many times the contour error. To be used as a contour error only
    when k' is so large that the miss does not matter.

The filter's bandwidth c' is the linear estimator of the paper's figure 2, of which the text gives
no equation; taken here as

    dw/dt = c' (-k' g / h - w),   dθ̂/dt = w                       (F)

whose characteristic polynomial is s² + c' s + c' k'. Between samples g/h is held and (F) integrated
exactly. The estimate of a sample is that of θ̂ as it stands when P is measured: P enters θ̂ for the
next sample. (8) alone, with c' infinite, is stable for k' T < 2; ``bind`` refuses what is not.

When the estimate fails:

* Several feet. θ̂ is the local minimum that it has followed, which after a jump of P or on the
  inside of a curve beyond its centre need not be the nearest. With (10), h < 0 about a local
  *maximum* of the distance would draw θ̂ to it; wherever (10) falls below 0.2 |R'|², (11) is taken.
  At the maximum itself g = 0: there θ̂ is pushed off, forwards, by a tenth of the distance.
* Ends. θ̂ stays in the domain of an open contour, where the error is that of the end point (in the
  projected form, of the tangent at the end); a closed one goes round.
* Corners. Derivatives are one-sided; at the inside of a corner the steps jump across it, and the
  converged form comes near the corner by halves only. It may stay behind at a corner until the
  reference point is nearer: its error is then up to the tracking error.

The gradient descent with which the paper compares has h constant,

    dθ̂/dt = -k' g / max |R'|²                                     (G)

with the largest |R'| of the contour, on 257 equally spaced parameters: at no place is it faster
than Newton's law, and slower where the parameter runs slower. On a path, over arc length, the two
are the same but for E·R''.

References
----------
.. [GhaffariUlsoy] section II; equation numbers are the paper's, but (F) and (G).

Differences from the paper
--------------------------
Sampled, with the exact solution of (F). The projected and the converged form, the fall-back from
(10) to (11), the bounds of open contours (the paper's parabola has none) and (G) are not in it. E
is not normalised to unit length: that belongs to the paper's control law.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import is_concrete, part, real, static
from contourlab.contour_errors.base import ContourEstimator, Estimator, EstimatorNeeds
from contourlab.contours.base import Contour, unit
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Derivatives, Scalar

__all__ = ["NewtonEstimator"]

_RATE = 500.0
"""k' and c' of the paper's simulations [1/s]."""
_ITERATIONS = 4
_LEAST_SHARE = 0.2
"""Of |R'|²: below it the full Hessian is not trusted."""
_LEVEL = 1e-6
"""Of |E| |R'|: a gradient below it is none."""
_NUDGE = 0.1
"""Of |E|: by how far θ̂ is pushed off where the distance is largest."""
_SPEEDS = 257
"""Parameters at which the largest |R'| is looked for."""


class NewtonState(NamedTuple):
    """What the estimator remembers."""

    parameter: Scalar
    """θ̂, the estimated parameter of the foot point, inside the domain."""
    rate: Scalar
    """w of (F), its filtered rate [1/s]; 0 in the converged form."""
    piece: Count
    """Piece of the contour that holds θ̂, int32."""


class NewtonEstimator(ContourEstimator):
    """Contour error vector at the foot point that Newton's method finds; see the module.

    Parameters
    ----------
    form
        ``"converged"``: iterated within each sample; ``"projected"``: the law in time, the error
        taken across the tangent; ``"filtered"``: the law in time as the paper has it.
    hessian
        ``"full"``: (10), with (11) where it is not to be trusted; ``"approximate"``: (11);
        ``"gradient"``: gradient descent (G), for comparison, not in the converged form.
    convergence_rate
        k' of the forms in time, > 0 [1/s]; 500, the paper's, when None.
    filter_rate
        c' of the forms in time, > 0 [1/s], infinite for no filter; 500, the paper's, when None.
    iterations
        Of the converged form, >= 1; 4 when None.

    Raises
    ------
    ConfigurationError
        A number out of bounds; one that the form does not use.
    """

    form: str = static(allowed=("converged", "projected", "filtered"), default="converged")
    hessian: str = static(allowed=("full", "approximate", "gradient"), default="full")
    convergence_rate: Float[Array, " ..."] | None = real(
        unit="1/s", above=0.0, ndim=0, default=None
    )
    filter_rate: Float[Array, " ..."] | None = real(
        unit="1/s", above=0.0, finite=False, ndim=0, default=None
    )
    iterations: int | None = static(minimum=1, default=None)

    def __check_init__(self) -> None:
        converged = self.form == "converged"
        unused = ("convergence_rate", "filter_rate") if converged else ("iterations",)
        for name in unused:
            if getattr(self, name) is not None:
                raise ConfigurationError(f"{name} has no effect in the form {self.form!r}")
        if converged and self.hessian == "gradient":
            raise ConfigurationError(
                "gradient descent does not converge in a fixed count of iterations: "
                "use the form 'projected' or 'filtered', or another hessian"
            )

    @property
    def needs(self) -> EstimatorNeeds:
        """The contour itself, and no derivatives at the reference parameter."""
        return EstimatorNeeds(derivatives=0, contour=True)

    def bind(self, contour: Contour, sample_time: Scalar) -> Estimator:
        """Return the estimator for one contour and sample time.

        Parameters
        ----------
        contour
            The path that the loop follows.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            The law in time is not stable at this sample time.
        """
        super().bind(contour, sample_time)
        rate = _RATE if self.convergence_rate is None else self.convergence_rate
        filtered = _RATE if self.filter_rate is None else self.filter_rate
        if self.form != "converged":
            _check_stable(rate, filtered, sample_time)
        fixed = self.hessian == "gradient"
        return BoundNewtonEstimator(
            form=self.form, hessian=self.hessian, contour=contour, sample_time=sample_time,
            rate=rate, cutoff=filtered, count=self.iterations or _ITERATIONS,
            largest=_largest_slope2(contour) if fixed else 1.0,
        )  # fmt: skip


class BoundNewtonEstimator(Estimator):
    """The estimator for one contour; made by :meth:`NewtonEstimator.bind`."""

    form: str = static()
    hessian: str = static()
    count: int = static(minimum=1)
    contour: Contour = part()
    sample_time: Scalar = real(unit="s", above=0.0)
    rate: Scalar = real(unit="1/s", above=0.0)
    cutoff: Scalar = real(unit="1/s", above=0.0, finite=False)
    largest: Scalar = real(above=0.0)

    @property
    def needs(self) -> EstimatorNeeds:
        """The contour itself, and no derivatives at the reference parameter."""
        return EstimatorNeeds(derivatives=0, contour=True)

    def init(self, sample: Sample) -> NewtonState:
        """Return the state before the first step: θ̂ at the reference parameter.

        Parameters
        ----------
        sample
            The first sample.
        """
        parameter, piece = self._place(sample.reference.parameter, jnp.zeros((), jnp.int32))
        return NewtonState(parameter, jnp.zeros(()), piece)

    def step(self, state: NewtonState, sample: Sample) -> tuple[AxisVector, NewtonState]:
        """Return the contour error vector [m] and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant, in tool space.
        """
        if self.form == "converged":
            return self._converge(state, sample)
        rows = self.contour.derivatives(state.parameter, 2, state.piece)
        error = rows[0] - sample.position
        newton = self.rate * self._newton_step(rows, error)  # (8)
        decay = -jnp.expm1(-self.cutoff * self.sample_time)
        # (F) with the right side held over the sample, exactly
        move = newton * self.sample_time + (state.rate - newton) * (decay / self.cutoff)
        parameter, piece = self._place(state.parameter + move, state.piece)
        if self.form == "projected":
            along = unit(rows[1])
            error = error - along * (along @ error)
        return error, NewtonState(parameter, state.rate + (newton - state.rate) * decay, piece)

    def estimate(self, sample: Sample) -> AxisVector:
        """Return the contour error vector from one sample alone, shape (n_coordinates,) [m].

        Parameters
        ----------
        sample
            One instant, in tool space; θ̂ starts at the reference parameter.
        """
        return self.step(self.init(sample), sample)[0]

    def _place(self, parameter: Scalar, piece: Count) -> tuple[Scalar, Count]:
        parameter = self.contour.wrap(jnp.asarray(parameter, float))
        return parameter, self.contour.locate(parameter, piece)

    def _newton_step(self, rows: Derivatives, error: AxisVector) -> Array:
        """Return -g / h."""
        slope2 = rows[1] @ rows[1]
        gradient = error @ rows[1]  # (9)
        full = error @ rows[2] + slope2  # (10)
        h = slope2  # (11)
        if self.hessian == "gradient":
            h = jnp.asarray(self.largest)  # (G)
        if self.hessian == "full":
            h = jnp.where(full < _LEAST_SHARE * slope2, slope2, full)
        move = -gradient / jnp.where(h == 0.0, 1.0, h)
        distance2 = error @ error
        level = (slope2 > 0.0) & (gradient**2 <= _LEVEL**2 * slope2 * distance2)
        farthest = level & (full < 0.0)
        away = _NUDGE * jnp.sqrt(jnp.where(farthest, distance2 / slope2, 1.0))
        return jnp.where(farthest, away, move)

    def _converge(self, state: NewtonState, sample: Sample) -> tuple[AxisVector, NewtonState]:
        point = sample.position

        def look(parameter: Scalar, piece: Count) -> tuple[Array, Array, Array]:
            rows = self.contour.derivatives(parameter, 2, piece)
            error = rows[0] - point
            return error, error @ error, self._newton_step(rows, error)

        def iterate(carry: Any, _: None) -> tuple[Any, None]:
            at, share = carry
            parameter, piece, _, squared, move = at
            new, new_piece = self._place(parameter + share * move, piece)
            tried = (new, new_piece, *look(new, new_piece))
            # at the foot the distance no longer tells a better parameter from rounding
            slack = 1e-10 * squared + 1e-15 * jnp.sqrt(squared * (point @ point))
            nearer = tried[3] <= squared + slack
            at = jax.tree.map(lambda a, b: jnp.where(nearer, a, b), tried, at)
            return (at, jnp.where(nearer, jnp.minimum(1.0, 2.0 * share), 0.25 * share)), None

        kept = (state.parameter, state.piece, *look(state.parameter, state.piece))
        parameter, piece = self._place(sample.reference.parameter, state.piece)
        anew = (parameter, piece, *look(parameter, piece))
        start = jax.tree.map(lambda a, b: jnp.where(anew[3] < kept[3], a, b), anew, kept)
        (at, _), _ = jax.lax.scan(iterate, (start, jnp.ones(())), None, length=self.count)
        return at[2], NewtonState(at[0], state.rate, at[1])


def _largest_slope2(contour: Contour) -> Array:
    start, end = contour.domain
    parameters = start + (end - start) * jnp.linspace(0.0, 1.0, _SPEEDS)
    slopes = jax.vmap(lambda p: contour.derivatives(p, 1)[1])(parameters)
    return jnp.max(jnp.sum(slopes**2, axis=1))


def _check_stable(rate: Any, cutoff: Any, sample_time: Any) -> None:
    """Raise RefusedError unless (F), sampled, is stable near the foot."""
    if not all(is_concrete(x) for x in (rate, cutoff, sample_time)):
        return
    k, c, dt = (np.asarray(x, float) for x in (rate, cutoff, sample_time))
    decay = -np.expm1(-c * dt)
    slow = 1.0 - k * dt + k * decay / c
    trace, determinant = slow + 1.0 - decay, slow * (1.0 - decay) + k * decay**2 / c
    if not np.all((determinant < 1.0) & (np.abs(trace) < 1.0 + determinant)):
        raise RefusedError(
            f"convergence_rate {np.max(k):g} 1/s with filter_rate {np.min(c):g} 1/s is not stable "
            f"at a sample time of {np.max(dt):g} s: lower the convergence rate, or use the form "
            "'converged'"
        )
