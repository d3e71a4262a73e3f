"""Predictive laws whose measurements get lost: they go by their model, and nothing of it stays."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.testing.samples import make_samples, sample_at

from .predictive_material import (
    PATHS,
    PLAIN,
    T,
    by_axis,
    law,
)


def beside(bound, samples, plant, lost, push=0.0, value=np.nan):
    """Close the loop with y = B/A (u + push) by hand; ``lost`` (n, n_axes) is not measured."""
    numerator, denominator = (jnp.asarray(p) for p in plant)
    n, n_axes = np.shape(lost)
    start = sample_at(samples, 0).position
    shown = jnp.where(jnp.asarray(lost), value, 0.0)
    pushes = jnp.broadcast_to(jnp.asarray(push), (n,))

    def at(k, y):
        sample = jax.tree.map(lambda x: jnp.asarray(x)[k], samples)
        return dataclasses.replace(sample, position=start + y[:, 0] + shown[k])

    def step(carry, k):
        state, y, u = carry
        command, state = bound.step(state, at(k, y))
        u = jnp.stack([command + pushes[k], u[:, 0]], 1)
        new = jnp.sum(numerator * u, 1) - jnp.sum(denominator[:, 1:] * y, 1)
        told = bound.telemetry(state).get("contour_error_estimate", jnp.zeros(n_axes))
        out = (command, y[:, 0], bound.status(state), told)
        return (state, jnp.stack([new, y[:, 0]], 1), u), out

    def whole(bound):
        zero = jnp.zeros((n_axes, 2))
        first = bound.init(at(0, zero))
        return jax.lax.scan(step, (first, zero, zero), jnp.arange(n))[1]

    return [np.asarray(x) for x in jax.jit(whole)(bound)]


LOST = np.zeros((60, 2), bool)
LOST[20:30, 0] = True
LOST[26:33, 1] = True


IDENTIFIED = {"plant_numerator": (2e-7,), "plant_denominator": (1.0, -1.97, 0.97)}
# with C a push that begins at once is known to what is left of it after twenty samples


@pytest.mark.parametrize(
    "controller",
    [
        law(noise_polynomial=(1.0, -0.3), delay=1, **IDENTIFIED),
        law(form="independent", noise_polynomial=(1.0, -0.5, 0.06)),
        law(**PLAIN),
        by_axis(disturbance_polynomial=(1.0, -0.8)),
    ],
    ids=["C, d", "independent, C", "no integrator", "by axis"],
)
@pytest.mark.parametrize("value", [np.nan, -np.inf])
def test_a_lost_measurement_is_what_the_model_expects(controller, value):
    """The axes are as modelled and push steadily: what is expected is what was not measured."""
    samples = make_samples(PATHS[2], 60, T, controller.needs, error=np.zeros(2))
    bound = controller.bind(PATHS[2], T)
    numerator, denominator = (np.asarray(p) for p in controller.plant(T))
    plant = np.append(np.zeros((2, controller.delay)), numerator, 1), denominator
    push = 3.0 * controller.disturbance_integrators
    whole = beside(bound, samples, plant, ~np.ones_like(LOST), push)
    found = beside(bound, samples, plant, LOST, push, value)
    scale = np.max(np.abs(whole[0]))
    assert np.max(np.abs(whole[0][19:34])) > 0.02 * scale
    assert_allclose(found[0], whole[0], rtol=0, atol=1e-7 * scale)
    assert_allclose(found[1], whole[1], rtol=0, atol=1e-12)
    assert_allclose(found[3], whole[3], rtol=0, atol=1e-12)
    assert_allclose(found[2], np.where(LOST.any(1), 3, whole[2]))


@pytest.mark.parametrize("make", [law, by_axis])
def test_nothing_of_a_lost_measurement_stays(make):
    """The first position is lost, and all while a force that nobody expects begins."""
    controller = make()
    samples = make_samples(PATHS[2], 60, T, controller.needs, error=np.zeros(2))
    lost = np.zeros((60, 2), bool)
    lost[0, 1] = lost[10:14] = True
    push = np.where(np.arange(60) < 11, 0.0, 30.0)
    plant = controller.plant(T)
    found = beside(controller.bind(PATHS[2], T), samples, plant, lost, push)
    assert all(np.all(np.isfinite(x)) for x in found)
    assert_allclose(found[2], np.where(lost.any(1), 3, 0))
    whole = beside(controller.bind(PATHS[2], T), samples, plant, ~np.ones_like(LOST), push)
    off = np.max(np.abs(found[1] - whole[1]), axis=1)
    # wrong while it goes by the model, and as if nothing had been a fifth of a second later
    assert np.max(off[14:20]) > 1e-5
    assert np.max(off[-5:]) < 0.01 * np.max(off[14:20])


def test_a_command_that_another_law_has_spoilt_is_not_remembered():
    controller = by_axis()
    bound = controller.bind(PATHS[2], T)
    sample = sample_at(make_samples(PATHS[2], 60, T, controller.needs), 9)
    wanted, proposal = bound.propose(bound.init(sample), sample)
    spoilt = jnp.array([np.nan, 1.0]) + wanted
    after = bound.settle(proposal, spoilt, spoilt)
    own = bound.settle(proposal, wanted, wanted)
    assert_allclose(after.history.commands[0], own.history.commands[0])
    assert_allclose(after.history.commands[1, 0], own.history.commands[1, 0] + 1.0)
