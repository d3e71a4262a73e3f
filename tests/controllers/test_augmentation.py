"""The internal model of a reference and a known disturbance is the two side by side."""

import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from numpy.testing import assert_allclose

from contourlab.contours import Circle
from contourlab.controllers import AxisPid, InternalModelContouring
from contourlab.controllers.augmentation import (
    augmented_transition,
    disturbance_blocks,
    regulator_solution,
)
from contourlab.controllers.exosystem import transition
from contourlab.feedrate import constant_rate
from contourlab.machines.published import cao_zhang_stage
from contourlab.machines.published.cao_zhang import cao_zhang_pulse_model
from contourlab.testing.samples import make_samples, sample_at

T = 1e-3
NUMERATOR, DENOMINATOR = cao_zhang_pulse_model()
A, B = DENOMINATOR[1], NUMERATOR[1]
G = np.array([[-A[0], 1.0], [-A[1], 0.0]])
FREQUENCIES = np.array([0.0, 7.0, 23.0])


def test_the_blocks_generate_a_constant_and_the_sinusoids():
    rotation, output = (np.asarray(x) for x in disturbance_blocks(3, FREQUENCIES, T))
    state, found = np.array([2.0, 1.0, 0.0, 0.0, 3.0]), []
    for _ in range(200):
        found.append(output @ state)
        state = rotation @ state
    k = T * np.arange(200)
    slow, fast = 2.0 * np.pi * FREQUENCIES[1:]
    wanted = 2.0 + np.cos(slow * k) + 3.0 / (fast * T) * np.sin(fast * k)
    assert_allclose(found, wanted, atol=1e-11)


def test_the_augmented_regulator_equations_split():
    """(A2) with Π_a = [Π 0], R_a = [R -Q_d], on the sinusoid of Figure 5; and without -Q_d not."""
    t = T * np.arange(60) + 0.3
    s = t + 0.1 * np.sin(5.0 * t)
    f, g = np.sin(s), s + 10.0
    turns = np.array([np.asarray(transition(f[k : k + 2], g[k : k + 2])) for k in range(59)])
    rotation, output = (np.asarray(x) for x in disturbance_blocks(3, FREQUENCIES, T))
    states, inputs = regulator_solution(A, B, turns)
    size = len(rotation)
    for k in range(59):
        before, after = (np.hstack([states[j], np.zeros((2, size))]) for j in (k, k + 1))
        disturbance = np.concatenate([[0.0, 0.0], output])
        for sign, holds in ((-1.0, True), (0.0, False)):
            given = np.concatenate([inputs[k], sign * output])
            left = after @ augmented_transition(turns[k], rotation)
            right = G @ before + np.outer(B, given + disturbance)
            off = np.max(np.abs(left - right))
            assert (off < 1e-12) == holds
        assert_allclose(before[0], np.concatenate([[1.0, 0.0], np.zeros(size)]))


def test_the_input_of_the_regulator_equations_moves_the_axis_along_its_reference():
    t = T * np.arange(200) + 0.3
    f, g = np.sin(t), np.cos(t)
    turns = np.array([np.asarray(transition(f[k : k + 2], g[k : k + 2])) for k in range(199)])
    states, inputs = regulator_solution(A, B, turns)
    x = states[0] @ [f[0], g[0]]
    for k in range(199):
        assert_allclose(x[0], f[k], atol=1e-10)
        x = G @ x + B * (inputs[k] @ [f[k], g[k]])


def test_the_modes_of_the_disturbance_are_modes_of_the_controller():
    """(A4), of the law itself: its step linearised over its own state, positions being given."""
    frequencies = FREQUENCIES[1:]
    axis = AxisPid(model=cao_zhang_stage().nominal, kp=[35e3, 11e3], ki=[170e3, 54e3], kd=400.0)
    law = InternalModelContouring(
        axis=axis, master=0, numerator=NUMERATOR, denominator=DENOMINATOR, identified_at=T,
        stabiliser_gain=[-1.5e6, -9.47e5], disturbance_observer_hz=40.0, reject_on="slaves",
        disturbance_frequencies_hz=frequencies,
    )  # fmt: skip
    contour = Circle(radius=1e-3)
    reference = constant_rate(contour, rate=2.0, duration=0.059, sample_time=T)
    bound = law.bind(contour, T)
    samples = make_samples(contour, 60, T, law.needs, reference=reference)
    step = jax.jit(lambda state, sample: bound.step(state, sample))
    state = bound.init(sample_at(samples, 0))
    for k in range(6):
        state = step(state, sample_at(samples, k))[1]
    flat, back = jax.flatten_util.ravel_pytree(state.disturbed)

    def onwards(values):
        after = step(state._replace(disturbed=back(values)), sample_at(samples, 6))[1]
        return jax.flatten_util.ravel_pytree(after.disturbed)[0]

    modes = np.linalg.eigvals(np.asarray(jax.jacfwd(onwards)(jnp.asarray(flat))))
    for f in FREQUENCIES:
        nearest = np.min(np.abs(modes - np.exp(2j * np.pi * f * T)))
        assert nearest < 1e-8, f
