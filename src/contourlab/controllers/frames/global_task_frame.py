"""The global task frame: coordinates that belong to the contour, wherever the reference is.

    r_c = f / |∇f|,    r_m = arc length of the foot point                                (1), (2)
    J = [tᵀ; nᵀ],    n = ∇f / |∇f|,    t = n turned left                                 (3)

f is an implicit form of the contour, positive on the right of travel. The error is e = (r_m - r_md,
r_c): no reference stands in the second, so that no lag along the path can be mistaken for a contour
error.

``form``
    ``"foot_point"`` (the default): f is the signed distance from the contour, found with the exact
    local foot point; any smooth planar contour has it. r_c is then the contour error itself.
    ``"implicit"``: the form of its own that a contour has in closed form (``has_level``), as in the
    paper: r_c is off by (r_c² / 2) n·H n / |∇f| (see :class:`GlobalTaskFrameEstimator`).

The error along the path is the length of the contour from the reference parameter to that of the
foot, by quadrature: 5 nodes of Gauss-Legendre over the short stretch between them, on paths the
difference of their parameter. It is never the sum of t · q' over the samples: the gradient of r_m
is t / (1 + κ r_c), so that such a sum drifts by 2π times the mean of r_c in every round of a closed
contour. Beyond the ends of an open contour the coordinates go on along its end tangent.

The frame turns as the tool moves, with H the Hessian of f,

    ψ' = (f_x f_y' - f_y f_x') / |∇f|²,    ∇f' = H q'                                    (4)

(with the signed distance ψ' = κ t · q' / (1 + κ r_c)), and the velocity at which e does not change,
v_0 = r_md' t, has v_0' = r_md'' t - ψ' r_md' n.

J is the paper's: unitary, exact on the contour. The true gradient of r_m is smaller by 1 + κ r_c;
with ``rate_from="velocity"`` the rate along is too large by that factor, which is 1e-4 at
κ = 20 1/m and 5 µm. The coordinates and their differences are exact.

Where it fails: at the centre of curvature the foot is no longer unique; far from the contour an
implicit form has a vanishing gradient; at the crossing of a figure of eight an implicit form cannot
tell the branches, while the foot point is looked for near the reference.

References
----------
.. [HuYaoWang] (1) to (3); (4) is not written there.

Differences from the paper
--------------------------
The order of the coordinates; the foot point by certified search; contours without an implicit form.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import part, static
from contourlab.contours.base import Contour, left_normal, unit
from contourlab.contours.foot_points import local_foot
from contourlab.contours.foot_points.contour_cells import cells_of
from contourlab.contours.path import Path
from contourlab.controllers.frames.coordinates import (
    BoundTaskFrame,
    TaskCoordinates,
    TaskFrame,
    refuse_not_planar,
)
from contourlab.controllers.frames.reference_frame import path_speed
from contourlab.controllers.smooth_path import refuse_corners
from contourlab.errors import RefusedError
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = ["BoundGlobalTaskFrame", "GlobalTaskFrame", "arc_between"]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_FOCAL = 1e-3
"""1 + κ r_c is held above this where the frame's turning is divided by it."""


class GlobalTaskFrame(TaskFrame):
    """Errors along and across the contour in coordinates of the contour; see the module.

    Parameters
    ----------
    form
        ``"foot_point"`` or ``"implicit"``.
    rate_from
        ``"coordinates"`` or ``"velocity"``.
    """

    form: str = static(allowed=("foot_point", "implicit"), default="foot_point")

    @property
    def derivatives(self) -> int:
        """2, for r_md''."""
        return 2

    @property
    def needs_contour(self) -> bool:
        """Always."""
        return True

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundGlobalTaskFrame:
        """Return the frame of one contour.

        Parameters
        ----------
        contour
            A planar contour.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            A contour that is not planar, has a corner, or has no implicit form of its own where
            one is asked for.
        """
        refuse_not_planar(type(self).__name__, contour)
        refuse_corners(type(self).__name__, contour)
        if self.form == "implicit" and not contour.has_level:
            raise RefusedError(
                f"GlobalTaskFrame with form 'implicit' needs an implicit form, and "
                f"{type(contour).__name__} has none of its own: use form 'foot_point'"
            )
        return BoundGlobalTaskFrame(
            rate_from=self.rate_from, sample_time=sample_time, form=self.form, contour=contour,
            cells=cells_of(contour),
        )  # fmt: skip


class BoundGlobalTaskFrame(BoundTaskFrame):
    """The frame of one contour; made by :meth:`GlobalTaskFrame.bind`."""

    form: str = static()
    contour: Contour = part()
    cells: Any = part()

    def locate(self, sample: Sample, piece: Count) -> Count:
        """Return the piece that holds the reference parameter.

        Parameters
        ----------
        sample
            This instant.
        piece
            Where to look first.
        """
        parameter = self.contour.wrap(jnp.asarray(sample.reference.parameter, float))
        return self.contour.locate(jax.lax.stop_gradient(parameter), piece)

    def coordinates(self, sample: Sample, piece: Count) -> TaskCoordinates:
        """Return the coordinates with the rate that the measured velocity gives.

        Parameters
        ----------
        sample
            This instant.
        piece
            As ``locate`` returned it.
        """
        position, velocity = sample.position, sample.velocity
        near = jnp.asarray(sample.reference.parameter, float)
        foot = local_foot(self.cells, position, near, piece)
        at = self.contour.wrap(foot.parameter)
        rows = self.contour.derivatives(at, 2, self.contour.locate(at, piece))
        tangent = unit(rows[1])
        # beyond an open end the foot stays there, and the tool is ahead of it along the tangent
        excess = (position - foot.position) @ tangent
        if self.form == "implicit":
            across, tangent, turning = self._implicit(position, velocity)
        else:
            across = (foot.position - position) @ left_normal(tangent)
            turning = _turning(rows, across, velocity @ tangent)
        normal = -left_normal(tangent)  # to the right
        speed, acceleration = path_speed(sample)  # r_md', r_md''
        along = arc_between(self.contour, near, foot.parameter) + excess
        jacobian = jnp.stack([tangent, normal])  # (3)
        rate = jnp.stack([tangent @ velocity - speed, normal @ velocity])
        return TaskCoordinates(
            jnp.stack([along, across]), rate, jacobian, turning, speed * tangent,
            acceleration * tangent - turning * speed * normal,
        )  # fmt: skip

    def _implicit(
        self, position: AxisVector, velocity: AxisVector
    ) -> tuple[Scalar, AxisVector, Scalar]:
        """Return r_c, the tangent and ψ' from the contour's own form."""
        f, gradient, hessian = self.contour.level_derivatives(position)
        square = gradient @ gradient
        safe = jnp.where(square > 0.0, square, 1.0)
        size = jnp.sqrt(safe)
        moved = hessian @ velocity
        turning = (gradient[0] * moved[1] - gradient[1] * moved[0]) / safe  # (4)
        return f / size, left_normal(gradient / size), turning  # (1)


def _turning(rows: Any, across: Scalar, speed: Scalar) -> Scalar:
    """Return ψ' of the signed distance."""
    squared = rows[1] @ rows[1]
    safe = jnp.where(squared > 0.0, squared, 1.0)
    bend = rows[1, 0] * rows[2, 1] - rows[1, 1] * rows[2, 0]
    curvature = bend / (safe * jnp.sqrt(safe))
    return jnp.asarray(curvature * speed / jnp.maximum(1.0 + curvature * across, _FOCAL))


def arc_between(contour: Contour, start: Scalar, end: Scalar) -> Scalar:
    """Return the length of a short stretch of contour, negative backwards [m].

    By 5 nodes of Gauss-Legendre: exact to the tenth order in the stretch, to rounding up to some
    tenths of the radius of curvature.

    Parameters
    ----------
    contour
        Which; the parameter of a path is its arc length already.
    start, end
        Parameters, near each other.
    """
    span = end - start
    if isinstance(contour, Path):
        return jnp.asarray(span, float)
    total: Array = jnp.zeros(())
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        slope = contour.derivatives(start + 0.5 * (1.0 + node) * span, 1)[1]
        total = total + weight * jnp.sqrt(slope @ slope)
    return jnp.asarray(0.5 * span * total)
