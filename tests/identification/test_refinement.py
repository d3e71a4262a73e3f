"""The refinement on a record so short that fitting takes out much, and where it is led astray."""

import numpy as np
from numpy.testing import assert_allclose

from contourlab.identification.pieces import cut_pieces
from contourlab.identification.refinement import Drive, misfit, refine

T = 5e-3
MASS, VISCOUS = 2.0, 12.0
FREE = ("mass", "viscous", "coulomb_forward", "coulomb_backward")


def test_few_reversals_and_white_noise_give_the_variance_of_white_noise():
    """σ² (Zᵀ Z)⁻¹ in the mean; of the scores alone it would be half of that."""
    rng = np.random.default_rng(9)
    t = T * np.arange(800)
    command = 3.0 * np.sin(4.0 * t) * (1.0 + 0.4 * np.cos(2.3 * t))
    decay = np.exp(-VISCOUS / MASS * T)
    position, velocity = np.zeros_like(t), np.zeros_like(t)
    for k, u in enumerate(command[:-1]):  # exact between samples
        end = u / VISCOUS
        velocity[k + 1] = end + (velocity[k] - end) * decay
        position[k + 1] = position[k] + end * T + (velocity[k] - end) * (1 - decay) * MASS / VISCOUS
    mean = np.append(0.5 * (velocity[1:] + velocity[:-1]), 0.0)
    pieces = cut_pieces(velocity, 0.02, longest=100, margin=2)
    theta = np.array([MASS, VISCOUS, 0.0, 0.0, 0.0, 0.0, 0.0])
    noise, draws, cosines = 1e-5, 16, 5
    found = []
    for _ in range(draws):
        seen = position + noise * rng.standard_normal(len(t))
        drive = Drive(command, 1.0 * (mean > 0.0), 1.0 * (mean < 0.0), seen)
        found.append(refine(theta, FREE, drive, None, pieces, T, cosines))
    assert all(one.converged and one.degrees == cosines for one in found)
    gram = found[0].gram * pieces.counts.sum()
    exact = noise**2 * np.diagonal(np.linalg.inv(gram))
    variance = np.array([np.diagonal(one.covariance) for one in found])
    # the mean of 16 chi-squares of 5 degrees, over 5: deviation √(2/5/16) = 16 %
    assert_allclose(variance.mean(axis=0) / exact, 1.0, atol=0.4)


def test_a_delay_without_bound_is_a_misfit_and_no_failure():
    """A position loop with feed-forward led the search there."""
    time = 1e-3 * np.arange(200)
    still = np.zeros(200)
    drive = Drive(still, np.ones(200), still, time**2)
    pieces = cut_pieces(np.ones(200), 0.5, longest=100)
    theta = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert np.isfinite(misfit(theta, drive, pieces, 1e-3))
    for delay in (1e30, -1e30, np.nan):
        theta[5] = delay
        assert misfit(theta, drive, pieces, 1e-3) == np.inf
