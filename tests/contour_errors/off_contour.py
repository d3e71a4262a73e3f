"""Points at a known place beside a contour: the exact error is known because it was put there."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import static
from contourlab.contours.base import Contour
from contourlab.recordings.reference import ReferencePoint
from contourlab.recordings.sample import Sample


class Curve(Contour):
    """A contour from a plain function."""

    function: object = static()
    dimension: int = static(default=2)
    span: tuple = static(default=(0.0, 2.0 * np.pi))
    goes_round: bool = static(default=False)

    @property
    def n_axes(self):
        return self.dimension

    @property
    def domain(self):
        return self.span

    @property
    def closed(self):
        return self.goes_round

    def position(self, parameter, piece=None):
        return self.function(parameter)


def beside(contour, parameters, lag, offset=0.0, binormal=0.0):
    """Return points behind reference parameters and beside the contour, and their error vectors.

    The foot lies the lag over the speed at the reference behind in the parameter. A point in the
    normal plane there, nearer than the centre of curvature, has its foot where it was put: no
    search is needed.
    """

    points, vectors = _beside(contour, jnp.asarray(parameters, float), lag, offset, binormal)
    return points, np.asarray(vectors)


@jax.jit
def _beside(contour, parameters, lag, offset, binormal):
    def one(p):
        slope = contour.derivatives(p, 1)[1]
        foot = p - lag / jnp.sqrt(slope @ slope)
        frame = contour.frenet(foot)
        vector = -offset * frame.normal
        if contour.n_axes == 3:
            vector = vector - binormal * frame.binormal
        return contour.position(foot) - vector, vector

    return jax.vmap(one)(parameters)


def sample(geometry, position, parameter=0.0):
    """Return one sample with a geometry and an actual point; the reference stands still."""
    geometry, point = jnp.asarray(geometry), jnp.asarray(position)
    zero, still = jnp.zeros(()), jnp.zeros_like(point)
    reference = ReferencePoint(
        parameter=jnp.asarray(parameter, float), parameter_rate=zero, parameter_acceleration=zero,
        position=geometry[0], velocity=still, acceleration=still, jerk=still,
    )  # fmt: skip
    none = jax.tree.map(lambda x: jnp.zeros((0, *x.shape)), reference)
    return Sample(zero, reference, geometry, none, point, still)


def estimates(estimator, contour, parameters, points, order=3):
    """Return what a stateless estimator says of points, each with its reference parameter."""
    return np.asarray(_estimates(estimator, contour, jnp.asarray(parameters), points, order))


@functools.partial(jax.jit, static_argnums=4)
def _estimates(estimator, contour, parameters, points, order):
    def one(parameter, point):
        return estimator.estimate(sample(contour.derivatives(parameter, order), point, parameter))

    return jax.vmap(one)(parameters, points)
