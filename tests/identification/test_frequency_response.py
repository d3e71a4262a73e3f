"""Frequency responses against closed forms, and the models that are fitted to them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.errors import ConfigurationError, RecordingError
from contourlab.identification import fit_frequency_response, frequency_response, is_sweep
from contourlab.machines import Drive, Encoder, Machine, RigidAxes, TwoMassAxes

from .machines import chirp, log_of, open_loop

T = 2.5e-4
SWEEP = np.stack([chirp(T, 6.0, 4.0, 600.0, 80.0), chirp(T, 6.0, 4.0, 600.0, 60.0)], axis=1)
MASS, VISCOUS, DELAY = np.array((5.0, 3.0)), np.array((25.0, 18.0)), 0.4e-3


def swept(dynamics, side="tool", noise=5e-9):
    machine = Machine(
        names=("X", "Y"), dynamics=dynamics,
        drive=Drive(command="force", computing_delay=DELAY),
        sensor=Encoder(noise=noise, side=side),
    )  # fmt: skip
    return log_of(open_loop(machine, SWEEP, T, seed=1), SWEEP, T, "force")


@pytest.fixture(scope="module")
def rigid():
    return frequency_response(swept(RigidAxes(mass=MASS, viscous=VISCOUS)))


def test_a_sweep_is_told_from_a_motion():
    assert is_sweep(SWEEP[:, 0], T)
    assert is_sweep(SWEEP[::-1, 0], T)
    t = np.arange(8000) * 1e-3
    noise = np.random.default_rng(0).standard_normal(8000)
    for signal in (np.sin(6 * t) + 0.1 * noise, np.sin(t * (4 + np.sin(2.3 * t))), noise, 0 * t):
        assert not is_sweep(signal, 1e-3)


def test_the_response_is_that_of_the_held_mass(rigid):
    for one, mass, viscous in zip(rigid, MASS, VISCOUS, strict=True):
        use = one.usable
        assert one.band[0] < 8.0
        assert one.band[1] > 400.0
        # the pulse transfer function of a mass under a held force, delayed
        f = one.frequency[use]
        z = np.exp(2j * np.pi * f * T)
        decay = np.exp(-viscous / mass * T)
        lag = mass / viscous
        gain = (T - lag * (1 - decay)) * z + lag * (1 - decay) - T * decay
        exact = gain / viscous / ((z - 1) * (z - decay))
        # its delay of 1.6 samples is not one of whole samples: taken as a phase, up to 200 Hz
        exact = exact * np.exp(-2j * np.pi * f * DELAY)
        slow = (f > 12.0) & (f < 200.0)  # away from where the sweep begins
        error = np.abs(one.response[use] / exact - 1.0)[slow]
        assert error.max() < 0.02
        assert np.median(error) < 0.003
        assert one.coherence[use].min() > 0.6


def test_a_mass_is_fitted_as_one(rigid):
    for one, mass in zip(rigid, MASS, strict=True):
        model = fit_frequency_response(one)
        assert model.model == "rigid"
        assert_allclose(model["mass"].value, mass, rtol=2e-3)
        assert_allclose(model["delay"].value, DELAY, atol=2e-6)
        assert model["mass"].low < model["mass"].value < model["mass"].high


def test_two_masses_are_found_by_their_resonance():
    axes = TwoMassAxes.by_frequency(
        mass=(30.0, 20.0), mass_ratio=(0.4, 0.6), anti_resonance_hz=(80.0, 110.0),
        damping_ratio=0.02, motor_viscous=(100.0, 80.0),
    )  # fmt: skip
    response = frequency_response(swept(axes, side="motor"))[0]
    model = fit_frequency_response(response)
    assert (model.model, model.side) == ("two_mass", "motor")
    assert_allclose(model.anti_resonance_hz, 80.0, rtol=1e-3)
    assert_allclose(model.resonance_hz, np.asarray(axes.resonance_hz)[0], rtol=1e-3)
    for name in ("motor_mass", "load_mass", "stiffness"):
        assert_allclose(model[name].value, np.asarray(getattr(axes, name))[0], rtol=1e-2)
    assert model.misfit < 1.5


def test_a_load_does_not_tell_how_masses_share():
    """Its response has no anti-resonance: sum and resonance are told, and no more."""
    axes = TwoMassAxes.by_frequency(
        mass=(30.0, 20.0), mass_ratio=(0.4, 0.6), anti_resonance_hz=(80.0, 110.0),
        damping_ratio=0.02, motor_viscous=(100.0, 80.0),
    )  # fmt: skip
    model = fit_frequency_response(frequency_response(swept(axes, noise=2e-8))[0], model="two_mass",
                                   side="load")  # fmt: skip
    for name, true in (("mass", 30.0), ("resonance", np.asarray(axes.resonance_hz)[0])):
        assert model.derived[name].low < true < model.derived[name].high
        assert_allclose(model.derived[name].value, true, rtol=2e-3)
    for name in ("motor_mass", "load_mass", "stiffness", "delay"):
        assert not model[name].identified
    assert np.isnan(model.anti_resonance_hz)


def test_the_ends_of_a_sweep_make_no_resonance():
    """A short sweep downwards, at whose end the mass goes on: no second mass is invented."""
    down = chirp(T, 2.0, 4.0, 600.0, 80.0)[::-1]
    command = np.stack([down, down], axis=1)
    machine = Machine(
        names=("X", "Y"), dynamics=RigidAxes(mass=MASS, viscous=VISCOUS),
        drive=Drive(command="force", computing_delay=DELAY), sensor=Encoder(noise=2e-8),
    )  # fmt: skip
    measured = open_loop(machine, command, T, seed=1)
    for one, mass, viscous in zip(
        frequency_response(log_of(measured, command, T, "force")), MASS, VISCOUS, strict=True
    ):
        model = fit_frequency_response(one)
        assert model.model == "rigid"
        for name, true in (("mass", mass), ("viscous", viscous), ("delay", DELAY)):
            assert model[name].low < true < model[name].high


def test_an_axis_that_was_not_swept_has_no_response():
    """At rest a loop makes a command of noise, with full coherence: the loop upside down."""
    random = np.random.default_rng(2)
    rest = 1e-7 * random.standard_normal(len(SWEEP))
    command = np.stack([SWEEP[:, 0], -1e6 * rest], axis=1)
    measured = np.stack([np.cumsum(np.cumsum(SWEEP[:, 0])) * T**2 / MASS[0], rest], axis=1)
    reference = np.stack([1e-6 * SWEEP[:, 0], 0.0 * rest], axis=1)
    swept_axis, still = frequency_response(log_of(measured, command, T, "force", reference))
    assert swept_axis.usable.any()
    assert (still.against, still.usable.any()) == ("nothing", False)
    with pytest.raises(RecordingError, match="axis Y was not swept"):
        fit_frequency_response(still)


def test_the_reference_is_better_than_a_noisy_command():
    """Noise that a loop feeds back is in command and position; against the excitation it is not."""
    dynamics = RigidAxes(mass=MASS, viscous=VISCOUS)
    machine = Machine(names=("X", "Y"), dynamics=dynamics, drive=Drive(command="force"))
    noise = 40.0 * np.random.default_rng(1).standard_normal(SWEEP.shape)
    measured = open_loop(machine, SWEEP + noise, T)
    # the noise is a force that the record of the command lacks in part: as if fed back
    log = log_of(measured, SWEEP + 0.5 * noise, T, "force")
    exact = log.dataset.assign(excitation=(("time", "axis"), SWEEP))
    errors = []
    for one, against in ((log, "command"), (type(log)(exact), "auto")):
        response = frequency_response(one, against=against)[0]
        use = response.usable & (response.frequency > 100.0) & (response.frequency < 400.0)
        s = 2j * np.pi * response.frequency[use]
        true = np.exp(-s * T / 2) / (MASS[0] * s**2 + VISCOUS[0] * s)
        errors.append(abs(np.mean(response.response[use] / true) - 1.0))
    assert errors[1] < 0.02
    assert errors[0] > 2.0 * errors[1]


def test_what_says_nothing_is_refused(rigid):
    for options in ({"against": "guess"}, {"resolution": -1.0}):
        with pytest.raises(ConfigurationError):
            frequency_response(swept(RigidAxes(mass=MASS, viscous=VISCOUS)), **options)
    short = log_of(np.zeros((100, 2)), np.zeros((100, 2)), T, "force")
    with pytest.raises(RecordingError, match="256 samples or more"):
        frequency_response(short)
    with pytest.raises(RecordingError, match="has no excitation"):
        frequency_response(swept(RigidAxes(mass=MASS, viscous=VISCOUS)), against="excitation")
    still = log_of(np.zeros((1000, 2)), np.zeros((1000, 2)), T, "force")
    one = frequency_response(still)[0]
    assert not one.usable.any()
    with pytest.raises(RecordingError, match="frequencies are usable"):
        fit_frequency_response(one)
    with pytest.raises(ConfigurationError):
        fit_frequency_response(rigid[0], model="three_mass")
