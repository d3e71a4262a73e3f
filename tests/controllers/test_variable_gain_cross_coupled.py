"""Koren and Lo's law: against their formulas, on circles, in the plane only."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contour_errors import OsculatingCircleEstimator
from contourlab.contours import Circle, Helix, Parabola
from contourlab.controllers import AxisPid, CrossCoupled, VariableGainCrossCoupled
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel
from contourlab.testing.controllers import check_controller
from contourlab.testing.protocol import run
from contourlab.testing.samples import make_samples, sample_at

T = 1e-3
GAINS = {"kp": 500.0, "ki": 6000.0, "kd": 8.0, "derivative_cutoff_hz": 90.0}


def pid(n=2, limit=1e4):
    model = NominalModel(
        mass=0.8 + 0.2 * np.arange(n), viscous=4.0 + np.arange(n), coulomb=np.full(n, 0.3),
        gain=np.full(n, 2.0), command_limit=np.full(n, limit), command="voltage",
    )  # fmt: skip
    return AxisPid(
        model=model, kp=300.0, ki=4000.0, kd=6.0, derivative_cutoff_hz=80.0,
        velocity_feed_forward=0.9, acceleration_feed_forward=0.8, friction_feed_forward=0.6,
        friction_velocity=0.02,
    )  # fmt: skip


def coupled(axis, **changes):
    return VariableGainCrossCoupled(axis=axis, **(GAINS | changes))


def test_conformance():
    check_controller(coupled(pid()))


@pytest.mark.parametrize("coefficient", [12.0, -12.0])  # turns left, turns right
def test_koren_and_los_formulas(coefficient):
    """e, φ and ρ as the paper has them, written out for y = h x²."""
    contour = Parabola(coefficient=coefficient, half_width=0.03)
    axis = pid()
    law = coupled(axis)
    samples = make_samples(contour, 150, T, law.needs)
    commands, _ = run(law.bind(contour, T), samples)
    by_axes, _ = run(axis.bind(contour, T), samples)
    decay = np.exp(-2.0 * np.pi * 90.0 * T)
    integral = derivative = 0.0
    last, out = None, []
    for k in range(150):
        x = float(samples.reference.parameter[k])
        e1, e2 = np.asarray(samples.reference.position[k] - samples.position[k])
        phi = np.arctan2(2.0 * coefficient * x, 1.0)
        rho = (1.0 + (2.0 * coefficient * x) ** 2) ** 1.5 / (2.0 * coefficient)
        cx, cy = np.sin(phi) - e1 / (2.0 * rho), np.cos(phi) + e2 / (2.0 * rho)
        error = -cx * e1 + cy * e2
        last = error if last is None else last
        derivative = decay * derivative + (1.0 - decay) * (error - last) / T
        last = error
        push = 500.0 * error + 6000.0 * integral + 8.0 * derivative
        out.append(by_axes[k] + np.array([-cx * push, cy * push]))
        integral += T * error
    assert_allclose(commands, out, rtol=0, atol=1e-9 * np.max(np.abs(commands)))


def test_close_to_the_path_it_is_cross_coupling_on_the_osculating_circle():
    """The gains turn by half the angle to the foot and the lag is 20 µm on a radius of 20 mm."""
    circle, axis = Circle(radius=0.02), pid()
    plain = CrossCoupled(axis=axis, estimator=OsculatingCircleEstimator(), **GAINS)
    law = coupled(axis)
    samples = make_samples(circle, 120, T, plain.needs)
    alone, _ = run(axis.bind(circle, T), samples)
    expected, found = (np.asarray(run(x.bind(circle, T), samples)[0]) - alone for x in (plain, law))
    # κ |e| = 1e-3, of which the gains see the half
    assert_allclose(found, expected, rtol=0, atol=2e-3 * np.max(np.abs(expected)))
    assert np.max(np.abs(expected)) > 1e-3


def test_the_integrals_are_held_at_the_limit():
    circle = Circle(radius=0.02)
    for kp, held in ((10.0, False), (1e6, True)):
        law = coupled(pid(limit=1.0), kp=kp, kd=0.0)
        samples = make_samples(circle, 3, T, law.needs, error=(1e-4, 1e-4))
        bound, sample = law.bind(circle, T), sample_at(samples, 0)
        command, state = bound.step(bound.init(sample), sample)
        assert (float(state.integral) == 0.0) == held
        assert int(bound.status(state)) == held
        assert np.max(np.abs(command)) <= 1.0


def test_it_is_for_the_plane():
    with pytest.raises(RefusedError, match=r"law for the plane.* 3 coordinates"):
        coupled(pid(3)).bind(Helix(radius=0.02, pitch=0.01, turns=1.0), T)
    with pytest.raises(RefusedError, match=r"3 axes, the contour 2 coordinates"):
        coupled(pid(3)).bind(Circle(radius=0.1), T)
    with pytest.raises(ConfigurationError, match=r"kp must be >= 0 command unit per m, got -1"):
        coupled(pid(), kp=-1.0)
    # called by hand: the test run's own type check would speak first
    with pytest.raises(ConfigurationError, match=r"axis must be an axis law.*SimpleNamespace"):
        VariableGainCrossCoupled.__check_init__(SimpleNamespace(axis=SimpleNamespace()))
