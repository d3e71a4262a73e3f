"""A derivative behind a first-order low-pass filter, discretised exactly.

D(s) = s N / (s + N) with N = 2 π times the cut-off frequency. For a signal that is linear between
its samples the response at the samples is, exactly,

    D_k = a D_(k-1) + (1 - a) (s_k - s_(k-1)) / T,    a = exp(-N T).

An infinite cut-off gives the plain backward difference. The same filter also takes a rate that is
measured; then (s_k - s_(k-1)) / T is replaced by the measurement.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, real
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["DerivativeState", "FilteredDerivative"]


class DerivativeState(NamedTuple):
    """What the filter remembers, each of shape (n_axes,)."""

    signal: AxisVector
    """The last sample of the signal."""
    value: AxisVector
    """The last filtered derivative."""


class FilteredDerivative(Configuration):
    """The discretised filter.

    Parameters
    ----------
    decay
        exp(-N T), what is left of the last value after one sample.
    sample_time
        T > 0 [s].
    """

    decay: Float[Array, " ..."] = real(unit="1", minimum=0.0, maximum=1.0)
    sample_time: Scalar = real(unit="s", above=0.0)

    @staticmethod
    def from_cutoff(cutoff_hz: Array, sample_time: Scalar) -> FilteredDerivative:
        """Return the filter of a cut-off frequency.

        Parameters
        ----------
        cutoff_hz
            Where the filter's gain has dropped by 3 dB [Hz]; infinite for no filter.
        sample_time
            [s].
        """
        return FilteredDerivative(
            decay=jnp.exp(-2.0 * np.pi * jnp.asarray(cutoff_hz) * sample_time),
            sample_time=sample_time,
        )

    def init(self, signal: AxisVector, rate: AxisVector) -> DerivativeState:
        """Return the state that a signal leaves which has had one rate for a long time.

        Parameters
        ----------
        signal
            The first sample.
        rate
            Its rate of change before; zero to start as though the signal had stood still.
        """
        return DerivativeState(signal - rate * self.sample_time, rate)

    def step(
        self, state: DerivativeState, signal: AxisVector, rate: AxisVector | None = None
    ) -> DerivativeState:
        """Return the new state; the derivative is its ``value``.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        signal
            The signal now.
        rate
            Its measured rate, to be filtered in place of the signal's difference.
        """
        raw = (signal - state.signal) / self.sample_time if rate is None else rate
        return DerivativeState(signal, self.decay * state.value + (1.0 - self.decay) * raw)
