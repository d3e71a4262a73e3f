"""A contour for laws in the task frame, and the paper's formulas written another way."""

import jax.numpy as jnp
import numpy as np

from contourlab.contours.base import ClosedFormContour
from contourlab.machines.base import NominalModel


class OvalHelix(ClosedFormContour):
    """x = a cos p, y = b sin p, z = c p: curvature and torsion vary; in closed form."""

    @property
    def n_axes(self):
        return 3

    @property
    def domain(self):
        return 0.0, 12.0

    @property
    def closed(self):
        return False

    def derivatives(self, parameter, order, piece=None):
        rows = []
        for k in range(order + 1):
            angle = parameter + 0.5 * np.pi * k
            climb = (0.016 * parameter, 0.016)[k] if k < 2 else 0.0
            rows.append(jnp.stack([0.03 * jnp.cos(angle), 0.01 * jnp.sin(angle), climb + 0.0]))
        return jnp.stack(rows)


def model(n=2, *, coulomb=0.3, limit=1e4, stiffness=None):
    return NominalModel(
        mass=0.8 + 0.2 * np.arange(n), viscous=4.0 + np.arange(n), coulomb=np.full(n, coulomb),
        gain=np.full(n, 2.0), command_limit=np.full(n, limit), command="voltage",
        stiffness=stiffness,
    )  # fmt: skip


def frame_over_time(d1, d2, d3, d4):
    """R, R', R'' and κ, τ, v from time derivatives of a spatial curve (Frenet's formulas)."""
    v, vd = np.linalg.norm(d1), d1 @ d2 / np.linalg.norm(d1)
    c, cd = np.cross(d1, d2), np.cross(d1, d3)
    size = np.linalg.norm(c)
    kappa = size / v**3
    tau = c @ d3 / size**2
    kappa_1 = c @ cd / (size * v**3) - 3.0 * kappa * vd / v
    tau_1 = c @ d4 / size**2 - 2.0 * tau * (c @ cd) / size**2
    tangent, binormal = d1 / v, c / size
    r = np.stack([tangent, np.cross(binormal, tangent), binormal], axis=1)

    def s(k, t):
        return np.array([[0.0, -k, 0.0], [k, 0.0, -t], [0.0, t, 0.0]])

    first = v * r @ s(kappa, tau)
    second = (
        vd * r @ s(kappa, tau)
        + v**2 * r @ s(kappa, tau) @ s(kappa, tau)
        + v * r @ s(kappa_1, tau_1)
    )
    return r, first, second, kappa, tau
