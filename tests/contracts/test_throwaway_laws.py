"""The contracts serve laws unlike those of the package, written here and thrown away.

Each runs in a hand-written scan, is made into a jaxpr, compiled, run untraced, vmapped over its
configuration and differentiated forwards and backwards, against finite differences.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Float
from numpy.testing import assert_allclose

from contourlab.configuration import part, real, replace, static
from contourlab.contour_errors import TangentEstimator
from contourlab.contour_errors.base import Estimator
from contourlab.contours import Circle, Ellipse, Line, Path
from contourlab.contours.base import Contour, unit
from contourlab.controllers.base import BoundController, Controller, Needs, in_tool_space
from contourlab.machines.base import LinearTool, ToolMap
from contourlab.recordings.reference import Reference
from contourlab.testing.controllers import check_controller
from contourlab.testing.samples import make_samples, rest_to_rest, sample_at
from contourlab.typing import Array

T = 1e-3
N = 50


class FindsItsOwnFoot(Controller):
    """Newton on the foot parameter, two iterations a step, evaluating the contour itself."""

    kp: Float[Array, " ..."] = real(minimum=0.0)
    kd: Float[Array, " ..."] = real(minimum=0.0)
    axes: int = static(default=2)

    @property
    def needs(self):
        return Needs(command="force", contour=True)

    @property
    def n_axes(self):
        return self.axes

    def bind(self, contour, sample_time):
        return BoundFindsItsOwnFoot(
            kp=self.kp, kd=self.kd, contour=contour, sample_time=sample_time
        )


class BoundFindsItsOwnFoot(BoundController):
    kp: Float[Array, " ..."] = real()
    kd: Float[Array, " ..."] = real()
    contour: Contour = part()
    sample_time: Float[Array, " ..."] = real()

    def init(self, sample):
        zero = jnp.zeros((), jnp.int32)
        foot = jnp.asarray(sample.reference.parameter)
        return foot, self.contour.locate(foot, zero)

    def step(self, state, sample):
        foot, piece = state
        foot = foot + sample.reference.parameter_rate * self.sample_time
        for _ in range(2):
            piece = self.contour.locate(foot, piece)
            d = self.contour.derivatives(foot, 2, piece)
            error = d[0] - sample.position
            foot = foot - (error @ d[1]) / (d[1] @ d[1] + error @ d[2])
        piece = self.contour.locate(foot, piece)
        d = self.contour.derivatives(foot, 1, piece)
        along = unit(d[1])
        command = self.kp * (d[0] - sample.position) + self.kd * along * (
            along @ (sample.reference.velocity - sample.velocity)
        )
        return command, (foot, piece)

    def telemetry(self, state):
        return {"foot_parameter": state[0]}


class LooksAhead(Controller):
    """A weighted mean of the next twenty reference points."""

    kp: Float[Array, " ..."] = real()
    weights: Float[Array, " ..."] = real(ndim=1)

    @property
    def needs(self):
        return Needs(command="velocity", preview=20)

    @property
    def n_axes(self):
        return 2

    def bind(self, contour, sample_time):
        del contour, sample_time
        return BoundLooksAhead(kp=self.kp, weights=self.weights)


class BoundLooksAhead(BoundController):
    kp: Float[Array, " ..."] = real()
    weights: Float[Array, " ..."] = real()

    def init(self, sample):
        del sample
        return ()

    def step(self, state, sample):
        aim = jnp.asarray(self.weights) @ sample.preview.position / jnp.sum(self.weights)
        return self.kp * (aim - sample.position), state


class FeedsSnapForward(Controller):
    """The fourth time derivative of the reference, from the contour's derivatives to order 4."""

    gains: Float[Array, " ..."] = real(ndim=1)

    @property
    def needs(self):
        return Needs(command="force", derivatives=4)

    @property
    def n_axes(self):
        return 2

    def bind(self, contour, sample_time):
        del contour, sample_time
        return BoundFeedsSnapForward(gains=self.gains)


class BoundFeedsSnapForward(BoundController):
    gains: Float[Array, " ..."] = real()

    def init(self, sample):
        del sample
        return ()

    def step(self, state, sample):
        g, v = sample.geometry, sample.reference.parameter_rate
        a = sample.reference.parameter_acceleration
        second = g[2] * v**2 + g[1] * a
        fourth = g[4] * v**4 + 6.0 * g[3] * v**2 * a + 3.0 * g[2] * a**2
        return self.gains[0] * second + self.gains[1] * fourth, state


class CoarseAndFine(Controller):
    """A stage that carries a scanner: the stage takes what is slow, the scanner the rest."""

    kp: Float[Array, " ..."] = real(ndim=1)
    handover_hz: Float[Array, " ..."] = real(unit="Hz", above=0.0)
    tool: ToolMap = part()
    estimator: Estimator = part()

    @property
    def needs(self):
        return Needs(
            command="velocity",
            derivatives=max(1, self.estimator.needs.derivatives),
            tool_map=True,
        )

    @property
    def n_axes(self):
        return 4

    def bind(self, contour, sample_time):
        return BoundCoarseAndFine(
            kp=self.kp,
            decay=jnp.exp(-2.0 * jnp.pi * self.handover_hz * sample_time),
            tool=self.tool,
            estimator=self.estimator.bind(contour, sample_time),
        )


class BoundCoarseAndFine(BoundController):
    kp: Float[Array, " ..."] = real()
    decay: Float[Array, " ..."] = real()
    tool: ToolMap = part()
    estimator: Estimator = part()

    def init(self, sample):
        tool_sample = in_tool_space(sample, self.tool)
        return {
            "slow": sample.geometry[0],
            "estimator": self.estimator.init(tool_sample),
            "error": jnp.zeros(2),
        }

    def step(self, state, sample):
        tool_sample = in_tool_space(sample, self.tool)
        error, estimator = self.estimator.step(state["estimator"], tool_sample)
        slow = self.decay * state["slow"] + (1.0 - self.decay) * sample.geometry[0]
        coarse = slow - sample.position[:2]
        fine = sample.geometry[0] - slow - sample.position[2:] + error
        command = self.kp * jnp.concatenate([coarse, fine])
        return command, {"slow": slow, "estimator": estimator, "error": error}

    def telemetry(self, state):
        return {"contour_error_estimate": state["error"]}


def square_with_arcs():
    """Four lines and four quarter arcs of 2 mm."""
    r, a = 2e-3, 8e-3
    start, tangent, normal, rate, length = [], [], [], [], []
    point = np.array([0.0, 0.0])
    for k in range(4):
        t = np.array([np.cos(k * np.pi / 2), np.sin(k * np.pi / 2)])
        n = np.array([-t[1], t[0]])
        for turn, size in ((0.0, a), (1.0 / r, r * np.pi / 2)):
            start.append(point)
            tangent.append(t)
            normal.append(n)
            rate.append(turn)
            length.append(size)
            point = point + (t * a if turn == 0.0 else r * t + r * n)
    zero = np.zeros_like(start)
    return Path.from_helical(start, tangent, normal, zero, rate, length, closed=True)


def four_axes(contour):
    """A reference of stage and scanner for a planar contour: 0.9 and 0.1 of every movement."""
    plane = rest_to_rest(contour, N, T)
    split = {
        name: np.concatenate([0.9 * getattr(plane, name), 0.1 * getattr(plane, name)], axis=1)
        for name in ("position", "velocity", "acceleration", "jerk")
    }
    return Reference(
        sample_time=T, parameter=plane.parameter, parameter_rate=plane.parameter_rate,
        parameter_acceleration=plane.parameter_acceleration, contour=contour, **split,
    )  # fmt: skip


SCANNER = LinearTool(matrix=[[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
COARSE_AND_FINE = CoarseAndFine(
    kp=[20.0, 20.0, 200.0, 200.0], handover_hz=15.0, tool=SCANNER, estimator=TangentEstimator()
)
ELLIPSE = Ellipse(semi_axes=(0.03, 0.01))
CASES = {
    "foot on an ellipse": (FindsItsOwnFoot(kp=100.0, kd=5.0), ELLIPSE, "kp"),
    "foot on a path": (FindsItsOwnFoot(kp=100.0, kd=5.0), square_with_arcs(), "kd"),
    "preview": (LooksAhead(kp=30.0, weights=np.linspace(1.0, 0.1, 20)), ELLIPSE, "weights"),
    "fourth derivatives": (FeedsSnapForward(gains=[0.8, 1e-4]), ELLIPSE, "gains"),
    "four axes": (COARSE_AND_FINE, ELLIPSE, "handover_hz"),
}


def setting(name):
    law, contour, field = CASES[name]
    reference = four_axes(contour) if law.n_axes != contour.n_axes else None
    return law, contour, field, make_samples(contour, N, T, law.needs, reference=reference)


def commands(law, contour, samples):
    """The hand-written loop."""
    bound = law.bind(contour, T)

    def step(state, sample):
        command, state = bound.step(state, sample)
        return state, (command, bound.telemetry(state), bound.status(state))

    state = bound.init(sample_at(samples, 0))
    _, (out, _, _) = jax.lax.scan(step, state, jax.tree.map(jnp.asarray, samples))
    return out


@pytest.mark.parametrize("name", CASES)
def test_traced_and_untraced(name):
    law, contour, _, samples = setting(name)
    text = str(jax.make_jaxpr(lambda law: commands(law, contour, samples))(law))
    assert "scan" in text
    compiled = jax.jit(lambda law: commands(law, contour, samples))(law)
    assert compiled.shape == (N, law.n_axes)
    assert compiled.dtype == np.float64
    bound = law.bind(contour, T)
    with jax.disable_jit():
        state = bound.init(sample_at(samples, 0))
        for k in range(8):
            command, state = bound.step(state, sample_at(samples, k))
            # rounding, times what Newton and the gains make of it
            assert_allclose(command, compiled[k], rtol=0, atol=1e-9 * np.max(np.abs(compiled)))


@pytest.mark.parametrize("name", CASES)
def test_vmapped_over_a_field(name):
    law, contour, field, samples = setting(name)
    value = np.asarray(getattr(law, field))
    batch = np.stack([value, 1.1 * value, 0.7 * value])
    run = jax.jit(lambda v: commands(replace(law, **{field: v}), contour, samples))
    together = jax.jit(jax.vmap(lambda v: commands(replace(law, **{field: v}), contour, samples)))(
        batch
    )
    for k in range(3):
        alone = run(batch[k])
        assert_allclose(together[k], alone, rtol=0, atol=1e-9 * np.max(np.abs(alone)))


@pytest.mark.parametrize("name", CASES)
def test_differentiated_both_ways(name):
    law, contour, field, samples = setting(name)
    value = jnp.asarray(getattr(law, field))
    weights = np.random.default_rng(5).normal(size=(N, law.n_axes))

    @jax.jit
    def loss(v):
        return jnp.sum(weights * commands(replace(law, **{field: v}), contour, samples))

    # several weights not in proportion: a mean does not mind that
    along = value * (1.0 + 0.3 * np.arange(value.size).reshape(value.shape))
    reverse = float(jnp.vdot(jax.jit(jax.grad(loss))(value), along))
    forward = float(jax.jit(lambda v: jax.jvp(loss, (v,), (along,))[1])(value))
    step = 1e-5
    difference = (loss(value + step * along) - loss(value - step * along)) / (2.0 * step)
    scale = max(abs(reverse), 1e-6 * abs(float(loss(value))))
    assert abs(reverse - forward) <= 1e-10 * scale
    assert abs(reverse - float(difference)) <= 1e-5 * scale  # rounding of the difference
    assert abs(reverse) > 0.0


@pytest.mark.parametrize("name", ["foot on an ellipse", "foot on a path"])
def test_differentiated_through_the_measurement(name):
    """A gradient that crosses the Newton steps and the look-up of the piece."""
    law, contour, _, samples = setting(name)

    @jax.jit
    def loss(shift):
        moved = eqx.tree_at(lambda s: s.position, samples, samples.position + shift)
        return jnp.sum(commands(law, contour, moved)[-1])

    zero, step = jnp.zeros(2), 1e-8
    backward, forward = jax.grad(loss)(zero), jax.jacfwd(loss)(zero)
    assert_allclose(backward, forward, rtol=1e-10)
    for k in range(2):
        e = step * jnp.eye(2)[k]
        assert_allclose(backward[k], (loss(e) - loss(-e)) / (2 * step), rtol=1e-5, atol=1e-4)


def test_the_foot_goes_round_all_pieces():
    law, contour, _, _ = setting("foot on a path")
    reference = rest_to_rest(contour, 400, T, share=0.99)
    samples = make_samples(contour, 400, T, law.needs, reference=reference)
    bound = law.bind(contour, T)
    state = bound.init(sample_at(samples, 0))
    _, (feet, pieces) = jax.lax.scan(
        lambda s, x: (lambda c: (c[1], c[1]))(bound.step(s, x)), state,
        jax.tree.map(jnp.asarray, samples),
    )  # fmt: skip
    assert set(np.asarray(pieces).tolist()) == set(range(8))
    points = jax.vmap(contour.position)(feet)
    miss = np.linalg.norm(points - samples.position, axis=1)
    assert np.max(miss) < 4e-5  # no further than the tracking error itself: 20 µm on either axis


def test_the_tool_of_four_axes_is_where_the_estimate_is_taken():
    law, contour, _, samples = setting("four axes")
    bound = law.bind(contour, T)
    sample = sample_at(samples, 20)
    _, state = bound.step(bound.init(sample), sample)
    tool = np.asarray(sample.position[:2] + sample.position[2:])
    normal = np.array([-sample.geometry[1, 1], sample.geometry[1, 0]])
    normal = normal / np.linalg.norm(normal)
    exact = normal * (normal @ (sample.geometry[0] - tool))
    assert_allclose(bound.telemetry(state)["contour_error_estimate"], exact, atol=1e-16)
    moved = in_tool_space(sample, SCANNER)
    assert_allclose(moved.velocity, sample.velocity[:2] + sample.velocity[2:], rtol=1e-14)


@pytest.mark.parametrize(
    ("name", "contour"),
    [("foot on an ellipse", Circle(radius=0.02)), ("preview", Line(start=(0, 0), end=(0.1, 0.2)))],
)
def test_they_pass_the_public_check(name, contour):
    check_controller(CASES[name][0], contour=contour)


def test_four_axes_pass_the_public_check():
    reference = rest_to_rest(ELLIPSE, 60, T)
    split = {
        name: np.concatenate([0.9 * getattr(reference, name), 0.1 * getattr(reference, name)], 1)
        for name in ("position", "velocity", "acceleration", "jerk")
    }
    whole = Reference(
        sample_time=T, parameter=reference.parameter, parameter_rate=reference.parameter_rate,
        parameter_acceleration=reference.parameter_acceleration, contour=ELLIPSE, **split,
    )  # fmt: skip
    check_controller(COARSE_AND_FINE, contour=ELLIPSE, reference=whole)
