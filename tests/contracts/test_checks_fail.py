"""The public checks see what they are for: every one fails on a law or estimator that breaks it."""

import itertools

import jax
import jax.numpy as jnp
import pytest
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contour_errors import TangentEstimator
from contourlab.contour_errors.base import Estimator
from contourlab.contours import Line
from contourlab.contours.base import unit
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.errors import RefusedError
from contourlab.testing.controllers import check_controller
from contourlab.testing.estimators import check_estimator
from contourlab.typing import Array

COUNTER = itertools.count()
LINE = Line(start=(0.0, 0.0), end=(0.03, 0.04))


class Law(Controller):
    """A proportional law; the subclasses below break one promise each."""

    kp: Float[Array, " ..."] = real()

    @property
    def needs(self):
        return Needs(command="force")

    @property
    def n_axes(self):
        return 2

    def bind(self, contour, sample_time):
        return BOUND[type(self)](kp=self.kp)


class Bound(BoundController):
    kp: Float[Array, " ..."] = real()

    def init(self, sample):
        return jnp.zeros(2)

    def step(self, state, sample):
        error = sample.reference.position - sample.position
        return self.kp * (error + 0.1 * state), state + error


BOUND = {Law: Bound}


def breaking(name, step=None, init=None, law=None, **members):
    """Return a law whose bound form differs in some functions."""
    functions = {"step": step, "init": init} | members
    bound = type(f"Bound{name}", (Bound,), {k: v for k, v in functions.items() if v})
    made = type(name, (Law,), law or {})
    BOUND[made] = bound
    return made(kp=3.0)


def error_of(sample):
    return sample.reference.position - sample.position


def impure(self, state, sample):
    return self.kp * error_of(sample) + next(COUNTER), state


def single_precision(self, sample):
    return jnp.zeros(2, jnp.float32)


def growing(self, state, sample):
    return self.kp * error_of(sample), jnp.concatenate([state, state])


def deaf(self, state, sample):
    return 3.0 * error_of(sample), state


def not_differentiable(self, state, sample):
    return jax.lax.stop_gradient(self.kp) * error_of(sample), state


def seen_only_untraced(self, state, sample):
    traced = isinstance(sample.position, jax.core.Tracer)
    return self.kp * error_of(sample) * (1.0 if traced else 1.1), state


def divides_by_the_error(self, state, sample):
    error = error_of(sample)
    return self.kp * error / (error @ error), state


def wrong_status(self, state):
    return jnp.ones((), jnp.int32)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (breaking("Impure", impure), "two answers"),
        (breaking("Single", init=single_precision), "float32"),
        (breaking("Growing", growing), r"\(2,\) became \(4,\)"),
        (breaking("Deaf", deaf), "kp changes nothing"),
        (breaking("Blunt", not_differentiable), "derivative of Blunt with respect to kp"),
        (breaking("TwoFaced", seen_only_untraced), "differs when traced"),
        (breaking("Divides", divides_by_the_error), "no finite command at zero"),
        (breaking("Status", status=wrong_status), "status 1 has no name"),
    ],
    ids=lambda x: type(x).__name__ if isinstance(x, Law) else None,
)
def test_a_broken_law_is_seen(law, message):
    with pytest.raises(AssertionError, match=message):
        check_controller(law, contour=LINE)


def test_a_sound_law_passes_and_a_false_declaration_is_seen():
    check_controller(Law(kp=3.0), contour=LINE)
    with pytest.raises(AssertionError, match="declared inert"):
        check_controller(Law(kp=3.0), contour=LINE, inert=["kp"])
    with pytest.raises(AssertionError, match="no field mass"):
        check_controller(Law(kp=3.0), contour=LINE, inert=["mass"])


def test_a_law_that_refuses_everything_is_seen():
    def refuse(self, contour, sample_time):
        raise RefusedError("not this one, for a reason")

    with pytest.raises(AssertionError, match="refuses every contour"):
        check_controller(breaking("Refuses", law={"bind": refuse}), contour=LINE)


class WrongSign(TangentEstimator):
    def estimate(self, sample):
        return -super().estimate(sample)


class WholeError(Estimator):
    def estimate(self, sample):
        return sample.geometry[0] - sample.position


class OneAxis(Estimator):
    """Vertical distance: neither exact nor the same when the plane is turned."""

    def estimate(self, sample):
        error = sample.geometry[0] - sample.position
        return jnp.zeros_like(error).at[1].set(error[1])


class FromVelocity(Estimator):
    """The tangent from the reference's velocity: undefined at rest."""

    def estimate(self, sample):
        error = sample.geometry[0] - sample.position
        v = sample.reference.velocity
        return error - v * (v @ error) / (v @ v)


class FromVelocityGuarded(Estimator):
    """The same, with nothing taken away at rest."""

    def estimate(self, sample):
        error = sample.geometry[0] - sample.position
        tangent = unit(sample.reference.velocity)
        return error - tangent * (tangent @ error) + 1e-7 * (1.0 - tangent @ tangent)


class Biased(TangentEstimator):
    def estimate(self, sample):
        return super().estimate(sample) + 1e-9


@pytest.mark.parametrize(
    ("estimator", "message"),
    [
        (WrongSign(), "wrong sign"),
        (WholeError(), "not exact on a line"),
        (OneAxis(), "off by"),
        (FromVelocity(), "not finite"),
        (FromVelocityGuarded(), "on the contour, not 0"),
        (Biased(), "on the contour, not 0"),
    ],
    ids=lambda x: type(x).__name__ if isinstance(x, Estimator) else None,
)
def test_a_broken_estimator_is_seen(estimator, message):
    with pytest.raises(AssertionError, match=message):
        check_estimator(estimator, contours=[LINE])
