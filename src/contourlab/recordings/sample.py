"""What a controller or an estimator is given at one instant."""

from __future__ import annotations

import equinox as eqx
from jaxtyping import Float

from contourlab.recordings.reference import ReferencePoint
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["Sample"]


class Sample(eqx.Module):
    """Everything a control law may know at one sampling instant; never the machine's true state.

    ``geometry`` and the contour live in tool space, everything else in axes. On a machine whose
    tool map is the identity the two are the same.
    """

    time: Scalar
    """Time of the sample [s]."""
    reference: ReferencePoint
    """The reference now."""
    geometry: Float[Array, "order_plus_one n_coordinates"]
    """Contour point and its derivatives over the parameter at the reference parameter, to the order
    in ``needs.derivatives``; no rows if the law asked for none."""
    preview: ReferencePoint
    """The next ``needs.preview`` reference points: row 0 is one sample ahead."""
    position: AxisVector
    """Measured axis positions [m]."""
    velocity: AxisVector
    """Measured axis velocities [m/s]."""
