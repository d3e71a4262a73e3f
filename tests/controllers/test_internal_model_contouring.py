"""Internal-model contouring and the PID in the position domain, and what they are made of."""

import functools
import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import contourlab as cl
from contourlab.configuration import replace
from contourlab.contour_errors import TangentEstimator
from contourlab.contours import Circle, Ellipse, Heart, Line, Lissajous, Sinusoid, combined, join
from contourlab.controllers import (
    AxisPid,
    AxisPredictive,
    Cascade,
    CrossCoupled,
    FirstOrderTaskFrame,
    InternalModelContouring,
    PositionDomainPid,
)
from contourlab.controllers.pulse_model import AxisObserver, PulseModel
from contourlab.controllers.stabiliser import (
    certified_half_width,
    closed_loop,
    design_stabiliser,
)
from contourlab.controllers.stabiliser_certificate import certify_gain, worst_radius
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.feedrate import constant_rate
from contourlab.machines import (
    Drive,
    Encoder,
    Friction,
    Machine,
    RigidAxes,
    SineDisturbance,
    StateSpaceAxes,
    StepDisturbance,
)
from contourlab.machines.base import NominalModel
from contourlab.machines.published import cao_zhang_stage, cao_zhang_stage_and_scanner
from contourlab.machines.published.cao_zhang import cao_zhang_pulse_model
from contourlab.papers.internal_model_runs import shaking
from contourlab.testing.controllers import check_controller

T = 1e-3
GAIN = 1e3 * np.array([-1500.0, -947.0])
NUMERATOR, DENOMINATOR = cao_zhang_pulse_model(4)


def model(n=2, limit=1e4):
    return NominalModel(
        mass=0.8 + 0.2 * np.arange(n), viscous=40.0 + 10.0 * np.arange(n), coulomb=np.zeros(n),
        gain=np.full(n, 2.0), command_limit=np.full(n, limit), command="voltage",
    )  # fmt: skip


def stage_pid():
    return AxisPid(
        model=cao_zhang_stage().nominal, kp=[34.96e3, 11.34e3], ki=[173.3e3, 54.11e3],
        kd=[400.0, 180.0],
    )  # fmt: skip


def stage_law(**changes):
    fields = {
        "axis": stage_pid(), "master": 0, "numerator": NUMERATOR[:2],
        "denominator": DENOMINATOR[:2], "identified_at": T, "stabiliser_gain": GAIN,
    }  # fmt: skip
    return InternalModelContouring(**(fields | changes))


CIRCLE = Circle(radius=1e-3)


@functools.cache
def round_trip(duration=5.0, rate=2.0):
    return constant_rate(CIRCLE, rate=rate, duration=duration, sample_time=T)


def largest(recording, start=3.5):
    """From after the master's start has died away; the master turns once after it."""
    return recording.metrics_between(start, 5.0)["contour_error_max"]


def test_on_its_own_model_the_contour_error_is_rounding():
    """The master lags by 1 um in phase; the slave's error is some roundings of 1 mm."""
    recording = cl.simulate(cao_zhang_stage(), stage_law(conversion="arccos"), round_trip())
    assert largest(recording) < 1e-14
    assert np.max(np.abs(np.asarray(recording["position_domain_error"])[3500:])) < 1e-15
    tracked = cl.simulate(cao_zhang_stage(), stage_law(), round_trip())
    assert largest(tracked) < 1e-12


def test_the_masters_amplitude_has_to_be_compensated():
    """Remark 4.1: without, it is short of the ends of its swing by |T1| - 1 of the radius."""
    z = np.exp(2j * T)
    c = 34.96e3 + 173.3e3 * T / (z - 1) + 400.0 * (1 - 1 / z) / T
    p = (NUMERATOR[0] @ [z, 1]) / (z**2 + DENOMINATOR[0] @ [z, 1])
    short = abs(abs(c * p / (1 + c * p)) - 1.0) * 1e-3
    bare = largest(cl.simulate(cao_zhang_stage(), stage_law(compensate_master=False), round_trip()))
    assert 0.3 * short < bare < 1.1 * short
    whole = largest(cl.simulate(cao_zhang_stage(), stage_law(), round_trip()))
    assert whole < 1e-4 * bare


def of_axis_law(kind):
    """An axis law of the stage, and the law on it, over the arc length of the circle."""
    nominal = cao_zhang_stage().nominal
    if kind == "pid":
        return stage_pid()
    if kind == "pid, measured velocity":
        return replace(stage_pid(), derivative_source="velocity", derivative_cutoff_hz=60.0)
    return Cascade(
        model=nominal, position_gain=60.0, velocity_proportional=[2000.0, 900.0],
        velocity_integral=[20e3, 9e3], velocity_feed_forward=0.8, acceleration_feed_forward=0.5,
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["pid", "pid, measured velocity", "cascade"])
def test_the_master_is_compensated_over_arc_length_and_under_other_axis_laws(kind):
    """1/T1 of each law at the angle's rate, s / R: the swing is the path's to rounding."""
    path = join([CIRCLE], closed=True).path
    reference = constant_rate(path, rate=2e-3, duration=5.0, sample_time=T)
    law = stage_law(axis=of_axis_law(kind), compensate_master=True)
    recording = cl.simulate(cao_zhang_stage(), law, reference)
    assert largest(recording, 4.0) < 1e-12
    # at 3π, 1 mm; a sample may be half of 2 mrad beside it. Without: 2e-8 m and more
    swing = np.min(np.asarray(recording["actual"])[4000:, 0])
    assert abs(swing + 1e-3) < 1e-9


def test_where_the_master_cannot_be_compensated_is_said():
    """A refusal to a law that was told to, a warning in the recording else; never nothing."""
    path = join([Ellipse(semi_axes=(1e-3, 5e-4))], closed=True).path
    with pytest.raises(RefusedError, match=r"cannot compensate its master .* no one frequency"):
        stage_law(compensate_master=True).bind(path, T)
    sine = Sinusoid(amplitude=1e-3, wavelength=6e-3)
    with pytest.raises(RefusedError, match="late, not short"):
        stage_law(compensate_master=True).bind(sine, T)
    predictive = AxisPredictive(model=cao_zhang_stage().nominal, input_weight=1e-9)
    with pytest.raises(RefusedError, match="the axis law is AxisPredictive"):
        stage_law(axis=predictive, compensate_master=True).bind(CIRCLE, T)
    reference = constant_rate(path, rate=1e-3, duration=0.1, sample_time=T)
    recording = cl.simulate(cao_zhang_stage(), stage_law(), reference)
    assert any("master's amplitude is not compensated" in text for text in recording.warnings)
    assert stage_law(compensate_master=False).bind(path, T).warnings() == ()
    assert stage_law().bind(sine, T).warnings() == ()


def test_the_recording_says_what_was_chosen_when_the_law_was_bound():
    reference = constant_rate(CIRCLE, rate=2.0, duration=0.1, sample_time=T)
    attributes = cl.simulate(cao_zhang_stage(), stage_law(master=None), reference).dataset.attrs
    assert attributes["master"] == (
        "axis 0, the slowest of the axes that can be, by the model; rotational"
    )
    assert "axis 1 master" in attributes["second_signal"]
    assert "gain as given; axis 1 certified for alpha within 0.37" in attributes["stabiliser"]
    assert stage_law(master=1).bind(CIRCLE, T).facts()["master"].startswith("axis 1, as asked")
    pid = PositionDomainPid(axis=stage_pid(), kp=11e3, master=1)
    assert pid.bind(CIRCLE, T).facts()["master"].startswith("axis 1, as asked")


def test_a_masters_error_of_known_frequency_is_no_contour_error():
    """Figure 5: r1 = t, and a disturbance shakes the master by 0.1 mm."""
    push = shaking(1e-4, 5.0)
    sine = Sinusoid(amplitude=1e-3, wavelength=6.2e-3, periods=2.0)
    reference = constant_rate(sine, rate=1e-3, duration=5.0, sample_time=T)
    law = stage_law(disturbance_observer_hz=40.0, reject_on="slaves")
    found = {}
    for name, changes in (
        ("unknown", {}), ("known", {"disturbance_frequencies_hz": [5.0 / (2.0 * np.pi)]}),
        ("rejected", {"disturbance_frequencies_hz": [5.0 / (2.0 * np.pi)], "reject_on": "all"}),
    ):  # fmt: skip
        found[name] = cl.simulate(
            cao_zhang_stage(), replace(law, **changes), reference, disturbances=push
        )  # fmt: skip
    swing = np.ptp(np.asarray(found["known"]["tracking_error"])[3000:, 0]) / 2.0
    assert_allclose(swing, 1e-4, rtol=0.01)
    assert largest(found["unknown"]) > 1e-8
    assert largest(found["known"]) < 1e-15
    rejected = np.asarray(found["rejected"]["tracking_error"])[3000:, 0]
    assert np.ptp(rejected) < 1e-3 * swing


def test_the_slave_makes_up_for_a_disturbed_master():
    """A step on the master: the tracking error is large, the contour error is not."""
    push = StepDisturbance(axis=0, amplitude=5.0, start=1.6)
    sine = Sinusoid(amplitude=1e-3, wavelength=6e-3, periods=3.0)
    reference = constant_rate(sine, rate=2e-3, duration=3.0, sample_time=T)
    recording = cl.simulate(cao_zhang_stage(), stage_law(), reference, disturbances=push)
    window = recording.metrics_between(1.5, 3.0)
    assert window["tracking_error_max"] > 50e-6
    assert window["contour_error_max"] < 0.02 * window["tracking_error_max"]


@pytest.mark.parametrize(
    ("push", "frequencies"),
    [
        (StepDisturbance(axis=1, amplitude=0.5), None),
        (SineDisturbance(axis=1, amplitude=0.5, frequency_hz=7.0), [7.0]),
    ],
    ids=["constant", "7 Hz"],
)
def test_a_known_disturbance_of_the_slave_is_taken_away(push, frequencies):
    bare = largest(cl.simulate(cao_zhang_stage(), stage_law(), round_trip(), disturbances=push))
    law = stage_law(disturbance_observer_hz=40.0, disturbance_frequencies_hz=frequencies)
    known = largest(cl.simulate(cao_zhang_stage(), law, round_trip(), disturbances=push))
    assert known < 1e-3 * bare
    assert known < 1e-11


def free_law(**changes):
    """Of axes without stiffness, as linear motors have them."""
    axis = AxisPid(model=model(limit=15.0), kp=2e4, ki=2e5, kd=200.0)
    return InternalModelContouring(axis=axis, stabiliser_gain=FREE_GAIN, **changes)


FREE_GAIN = (-8e5, -6e5)
"""Poles within 0.64 on axes of :func:`model`, at 1 ms."""


def test_axes_that_nothing_holds_are_observed_by_default_and_warned_of_without():
    off = free_law(disturbance_observer_hz=0.0).bind(CIRCLE, T)
    (warning,) = off.warnings()
    assert "axis 0: no stiffness" in warning
    assert "give disturbance_observer_hz" in warning
    assert "disturbance_observer" not in off.facts()
    by_default = free_law(master_observer_hz=80.0).bind(CIRCLE, T)
    assert by_default.warnings() == ()
    assert "80 Hz on the slaves; axis 0: no stiffness" in by_default.facts()["disturbance_observer"]
    given = free_law(master_observer_hz=80.0, disturbance_observer_hz=80.0).bind(CIRCLE, T)
    assert given.facts().keys() == off.facts().keys()
    assert_array_equal(by_default.slave_observer.gain, given.slave_observer.gain)
    assert by_default.rejects
    # the paper's axes are stable: as they were
    stage = stage_law().bind(CIRCLE, T)
    assert stage.warnings() == ()
    assert (
        stage.slave_observer.gain.shape
        == stage_law(disturbance_observer_hz=0.0).bind(CIRCLE, T).slave_observer.gain.shape
    )
    assert not stage.rejects
    with pytest.raises(ConfigurationError, match="goes with disturbance_observer_hz, which is 0"):
        free_law(disturbance_observer_hz=0.0, disturbance_frequencies_hz=[3.0])


@pytest.mark.slow
def test_under_dry_friction_the_copy_of_a_free_axis_runs_away_unless_it_is_observed():
    """What is warned of, on a linear motor: the copy is given 5 N that the axis does not get."""
    dynamics = RigidAxes(mass=(10.0, 6.0), viscous=(30.0, 20.0))
    drive = Drive(command="force", command_limit=150.0)
    told = Machine(names=("X", "Y"), dynamics=dynamics, drive=drive, sensor=Encoder(), substeps=10)
    dry = replace(dynamics, friction=Friction(coulomb=5.0, smoothing_velocity=1e-4))
    axis = AxisPid(
        model=told.nominal, kp=(2e5, 1.2e5), ki=(2e6, 1.2e6), kd=(2e3, 1.2e3),
        velocity_feed_forward=1.0, acceleration_feed_forward=1.0,
    )  # fmt: skip
    ellipse = Ellipse(semi_axes=(0.02, 0.01))
    reference = constant_rate(ellipse, rate=1.5, duration=4.0, sample_time=T)
    errors = []
    for hz in (0.0, None, 40.0):
        law = InternalModelContouring(axis=axis, engage_time=0.2, disturbance_observer_hz=hz)
        found = cl.simulate(replace(told, dynamics=dry), law, reference)
        errors.append(found.metrics_between(1.0, 4.0)["contour_error_rms"])
    assert errors[0] > 1e-4  # a millimetre at most, the command at its limit
    assert max(errors[1:]) < 1e-6


def test_engaging_late_is_engaging_without_a_jump_of_the_command():
    recording = cl.simulate(cao_zhang_stage(), stage_law(engage_time=1.0), round_trip())
    status = np.asarray(recording["status"])
    assert np.all(status[:1000] == 2)
    assert np.all(status[1000:] != 2)
    assert largest(recording) < 1e-12
    # the PID's lag of 1 um has to be made good: K times that, and no more
    command = np.abs(np.asarray(recording["command"])[1000:, 1])
    assert np.max(command) < 2.0 * 1.5e6 * 1e-6 + 0.5


def four_axis_law():
    axis = AxisPid(
        model=cao_zhang_stage_and_scanner().nominal, kp=[34.96e3, 11.34e3, 500.0, 500.0],
        ki=[173.3e3, 54.11e3, 2e4, 2e4], kd=[400.0, 180.0, 0.0, 0.0],
    )  # fmt: skip
    gains = np.array([GAIN, 1e3 * np.array([-41.15, -26.41]), 1e3 * np.array([-41.15, -26.41])])
    return InternalModelContouring(
        axis=axis, master=0, numerator=NUMERATOR, denominator=DENOMINATOR, identified_at=T,
        stabiliser_gain=gains,
    )  # fmt: skip


def four_axis_reference(matrix):
    path = Lissajous(
        amplitudes=np.array([1e-3, 1e-3, 1e-4, 1e-4]),
        frequencies=(1.0, 1.0, 10.0, 10.0),
        phases=np.array([0.5 * np.pi, 0.0, 0.5 * np.pi, 0.0]),
    )
    reference = constant_rate(path, rate=2.0, duration=5.0, sample_time=T)
    return replace(reference, contour=combined(path, matrix))


def test_four_axes_move_one_tool_and_laws_of_the_tool_say_why_they_cannot():
    machine = cao_zhang_stage_and_scanner()
    reference = four_axis_reference(machine.tool.matrix)
    law = four_axis_law()
    assert largest(cl.simulate(machine, law, reference)) < 1e-12
    coupled = CrossCoupled(axis=law.axis, estimator=TangentEstimator(), kp=1e3)
    with pytest.raises(RefusedError, match=r"CrossCoupled .* 4 axes share 2 coordinates"):
        cl.simulate(machine, coupled, reference)
    alone = cl.simulate(machine, law.axis, reference)  # axis laws ask nothing of the tool
    assert largest(alone) > 1e-6
    why = r"FirstOrderTaskFrame is for machines of 2 or 3 .* axes that share a coordinate"
    with pytest.raises(RefusedError, match=why):
        FirstOrderTaskFrame(model=machine.nominal, bandwidth_hz=np.full(4, 10.0))
    other = four_axis_reference(np.abs(np.asarray(machine.tool.matrix)))
    with pytest.raises(RefusedError, match="combines the axes in another way"):
        cl.simulate(machine, law, other)
    with pytest.raises(RefusedError, match=r"contours\.combined"):
        cl.simulate(machine, law, replace(reference, contour=CIRCLE))


def test_axes_of_third_order_go_through_the_filter():
    """The stage behind a pole at 0.5 and a zero at -0.2: the exosystem is brought to order 3."""
    bottom = np.array([np.convolve([1.0, *a], [1.0, -0.5])[1:] for a in DENOMINATOR[:2]])
    top = np.array([np.convolve(b, [0.5 / 1.2, 0.1 / 1.2]) for b in NUMERATOR[:2]])
    axes = [
        StateSpaceAxes(
            state_matrix=np.column_stack([-a, np.eye(3)[:, :2]]), input_matrix=b[:, None],
            output_matrix=[[1.0, 0.0, 0.0]], sample_time=T,
        )
        for a, b in zip(bottom, top, strict=True)
    ]  # fmt: skip
    machine = replace(cao_zhang_stage(), dynamics=StateSpaceAxes.per_axis(axes))
    # S z with α at (-2, 1), by pole placement on the companion form
    b = top[1]
    matrix = np.eye(3, k=1)
    matrix[:2, 0] = 2.0, -1.0
    scaled = b / b[0]
    reach = np.column_stack([scaled, matrix @ scaled, matrix @ matrix @ scaled])
    wanted = np.linalg.matrix_power(matrix - 0.3 * np.eye(3), 3)
    gain = -(np.linalg.solve(reach.T, [0.0, 0.0, 1.0]) @ wanted) / b[0]
    law = stage_law(numerator=top, denominator=bottom, stabiliser_gain=gain)
    assert largest(cl.simulate(machine, law, round_trip())) < 1e-12


def test_an_axis_that_cannot_be_inverted_is_refused():
    """Three lags in a row, sampled: a zero at -1.8."""
    top = np.vstack([NUMERATOR[0], 1e-6 * np.array([1.0, 1.8])])
    with pytest.raises(RefusedError, match=r"axis 1 has one at -1\.8"):
        stage_law(numerator=top).bind(CIRCLE, T)
    late = np.vstack([NUMERATOR[0], [0.0, 1e-6]])
    with pytest.raises(RefusedError, match="two samples later"):
        stage_law(numerator=late).bind(CIRCLE, T)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"identified_at": None}, "identified_at not given"),
        ({"numerator": NUMERATOR}, "must have one shape"),
        ({"disturbance_frequencies_hz": [3.0]}, "goes with disturbance_observer_hz"),
        ({"second_signal": "sine"}, "second_signal"),
        ({"turning_width": 1.0}, "turning_width must be < 1"),
        ({"turning_width": 0.1, "conversion": "arccos"}, "turning_width goes with conversion"),
        ({"offset": 0.1, "second_signal": "master"}, "offset is added to the position"),
        ({"reject_on": "slaves"}, "goes with disturbance_observer_hz"),
    ],
)
def test_configurations_that_do_not_go_are_refused(changes, text):
    with pytest.raises(ConfigurationError, match=text):
        stage_law(**changes)


def test_paths_that_do_not_go_are_refused():
    with pytest.raises(RefusedError, match="axis must be for 2 axes or more"):
        stage_law(axis=AxisPid(model=model(1), kp=1.0))
    with pytest.raises(ConfigurationError, match=r"identified at 0\.001 s"):
        stage_law().bind(CIRCLE, 2e-3)
    with pytest.raises(ConfigurationError, match="stabiliser_gain must have 2 values"):
        stage_law(stabiliser_gain=np.ones(3)).bind(CIRCLE, T)
    with pytest.raises(RefusedError, match=r"axis 1 for its master: it turns back"):
        stage_law(master=1).bind(Heart(radius=1e-3), T)
    with pytest.raises(RefusedError, match=r"spectral radius of 2\.1.* must be < 1"):
        stage_law(stabiliser_gain=-0.5 * GAIN).bind(CIRCLE, T)
    with pytest.raises(RefusedError, match=r"radius of 1\.18.* at alpha = \(-2\.5, 0\.5\)"):
        stage_law(stabiliser_range=0.5).bind(CIRCLE, T)
    with pytest.raises(RefusedError, match=r"must be < 0\.2"):
        stage_law(stabiliser_decay=0.2).bind(CIRCLE, T)
    with pytest.raises(ConfigurationError, match="which is the best of none"):
        stage_law(offset=0.1).bind(CIRCLE, T)
    with pytest.raises(RefusedError, match="it only rises or only falls"):
        stage_law(conversion="arccos").bind(Sinusoid(amplitude=1e-3, wavelength=6e-3), T)
    with pytest.raises(ConfigurationError, match="master must be one of the 2 axes"):
        stage_law(master=2).bind(CIRCLE, T)
    arc = join([CIRCLE.between(0.2, 6.0)], tolerance=1e-7).path  # over arc length
    with pytest.raises(RefusedError, match="cosine of the contour parameter"):
        stage_law(conversion="arccos").bind(arc, T)
    corner = join([Line(start=(0, 0), end=(0.01, 0.0)), Line(start=(0.01, 0.0), end=(0.02, 0.01))])
    with pytest.raises(RefusedError, match="corner"):
        stage_law().bind(corner.path, T)
    with pytest.raises(RefusedError, match="commands 2 axes, the path has 4"):
        stage_law().bind(four_axis_reference(np.eye(4)[:2]).contour, T)


# -- what they are made of ---------------------------------------------------------------------


def test_the_pulse_model_is_the_axis_at_its_samples():
    """M q'' + B q' + S q = K u with a held command, against scipy's discretisation."""
    from scipy.signal import cont2discrete

    axes = replace(model(), stiffness=np.array([0.0, 900.0]))
    found = PulseModel.of_model(axes, T)
    for k in range(2):
        m, b = axes.mass[k], axes.viscous[k]
        top, bottom, _ = cont2discrete(([axes.gain[k]], [m, b, axes.stiffness[k]]), T)
        assert_allclose(found.denominator[k], bottom[1:], rtol=1e-9)
        assert_allclose(found.numerator[k], top[0, 1:], rtol=1e-6)
    state, command = found.rest(jnp.array([0.1, -0.2]))
    assert_allclose(found.advance(state, command), state, atol=1e-15)


@pytest.mark.parametrize("frequencies", [[], [0.0], [0.0, 7.0], [0.0, 3.0, 11.0]])
def test_all_poles_of_the_observer_are_where_they_were_put(frequencies):
    """det(z I - A + L C) = (z - λ)^n at a few z, with A built here."""
    pulse = PulseModel(denominator=DENOMINATOR[:1], numerator=NUMERATOR[:1])
    observer = AxisObserver.of_model(pulse, np.array([40.0]), np.asarray(frequencies, float), T)
    size = 2 + len(observer.output)
    whole = np.zeros((size, size))
    whole[:2, 0] = -DENOMINATOR[0]
    whole[0, 1] = 1.0
    whole[:2, 2:] = np.outer(NUMERATOR[0] / NUMERATOR[0, 0], observer.output)
    whole[2:, 2:] = observer.rotation
    whole[:, 0] -= np.asarray(observer.gain)[0]
    pole = np.exp(-2 * np.pi * 40.0 * T)
    for z in (1.3, -0.7, 0.2 + 0.9j):
        assert_allclose(np.linalg.det(z * np.eye(size) - whole), (z - pole) ** size, rtol=1e-6)
    for f in frequencies:  # the model holds what it is to hold
        turn = np.exp(2j * np.pi * f * T)
        assert abs(np.linalg.det(turn * np.eye(size - 2) - np.asarray(observer.rotation))) < 1e-9


def test_the_published_gain_is_nearly_dead_beat():
    """Its poles at α = (-2, 1): a plus-sign feedback, |z| = 0.298."""
    loop = closed_loop((-2.0, 1.0), NUMERATOR[1], GAIN)
    assert_allclose(np.abs(np.linalg.eigvals(loop)), 0.298, atol=1e-3)


def test_the_certificate_is_one():
    """Everywhere in the box, with the scheduled gain: the state falls by ρ² a sample."""
    design = design_stabiliser(NUMERATOR[1], half_width=0.1, decay=0.7)
    assert design.margin > 0.0
    rng = np.random.default_rng(0)
    inverse = np.linalg.inv(design.lyapunov)

    def weighted(share, table):
        (s, t) = share
        return (1 - s) * ((1 - t) * table[0, 0] + t * table[0, 1]) + s * (
            (1 - t) * table[1, 0] + t * table[1, 1]
        )

    for now, later in rng.uniform(0, 1, (200, 2, 2)):
        alpha = np.array([-2.0, 1.0]) + 0.1 * (2.0 * now - 1.0)
        gain = design.gain[0] + now[0] * (design.gain[1] - design.gain[0])
        loop = closed_loop(alpha, NUMERATOR[1], gain)
        p, p_later = weighted(now, inverse), weighted(later, inverse)
        falls = design.decay**2 * p - loop.T @ p_later @ loop
        assert np.linalg.eigvalsh(falls)[0] > 0.0


@pytest.mark.parametrize("decay", [0.5, 0.9])
def test_the_least_gain_for_a_decay_is_that_of_poles_there(decay):
    """And not nearly dead-beat whatever is asked for."""
    b = NUMERATOR[1]
    design = design_stabiliser(b, half_width=1e-4, decay=decay, least_gain=True)
    assert design.margin > 0.0
    for alpha, gain in zip((-2.0001, -1.9999), design.gain, strict=True):
        radius = np.max(np.abs(np.linalg.eigvals(closed_loop((alpha, 1.0), b, gain))))
        assert 0.9 * decay < radius < decay
    # A + b K with the polynomial (z - ρ)²: its trace and its determinant
    rows = np.array([[b[0], b[1]], [-b[1], 2.0 * b[1] + b[0]]])
    placed = np.linalg.solve(rows, [2.0 * decay - 2.0, decay**2 - 1.0])
    assert np.linalg.norm(design.gain[0]) < 1.25 * np.linalg.norm(placed)
    middle = design_stabiliser(b, half_width=1e-4, decay=decay)
    share = np.linalg.norm(design.gain[0]) / np.linalg.norm(middle.gain[0])
    assert share < (0.7 if decay < 0.6 else 0.2)


def test_how_far_the_published_gain_is_certified():
    """0.37; at 0.5 the loop is unstable at a corner, so that no form could certify it."""
    width = certified_half_width(NUMERATOR[1], GAIN)
    assert_allclose(width, 0.376, atol=1e-3)
    found = certify_gain(NUMERATOR[1], GAIN)
    assert 0.99 * width < found.half_width < width + 1e-3  # without a solver
    assert found.margin > 0.0
    assert worst_radius(NUMERATOR[1], GAIN, found.half_width)[0] < 1.0
    assert worst_radius(NUMERATOR[1], GAIN, 0.5)[0] > 1.0
    assert certify_gain(NUMERATOR[1], GAIN, at_most=0.2).half_width == 0.2
    assert certify_gain(NUMERATOR[1], -GAIN).half_width == 0.0
    with pytest.raises(RefusedError, match="no gain is certified"):
        design_stabiliser(NUMERATOR[1], half_width=1.5, decay=0.5)
    with pytest.raises(ConfigurationError, match="decay must be"):
        design_stabiliser(NUMERATOR[1], decay=1.0)


def test_within_the_certified_box_products_of_loops_fall_however_alpha_moves():
    """What the certificate of a given gain says, tried: 200 samples of corners at random."""
    width = 0.999 * certify_gain(NUMERATOR[1], GAIN).half_width
    rng = np.random.default_rng(5)
    product = np.eye(2)
    for signs in rng.choice([-1.0, 1.0], (200, 2)):
        product = closed_loop(np.array([-2.0, 1.0]) + width * signs, NUMERATOR[1], GAIN) @ product
    assert np.max(np.abs(product)) < 1e-12


def test_a_gain_for_an_axis_of_third_order_is_found_and_certified():
    """A pole at 0.5 and a zero at -0.2 beside those of the stage."""
    top = np.convolve(NUMERATOR[1], [0.5 / 1.2, 0.1 / 1.2])
    design = design_stabiliser(top, half_width=0.02, decay=0.8)
    assert design.gain.shape == (2, 3)
    assert design.margin > 0.0
    inverse = np.linalg.inv(design.lyapunov)
    for i, j, later_i, later_j in itertools.product((0, 1), repeat=4):
        alpha = np.array([-2.0, 1.0]) + 0.02 * np.array([2 * i - 1.0, 2 * j - 1.0])
        # (34) written out, in states divided by b_1
        loop = np.array([[-alpha[0], 1.0, 0.0], [-alpha[1], 0.0, 1.0], [0.0, 0.0, 0.0]])
        loop = loop + np.outer(top, design.gain[i])
        falls = design.decay**2 * inverse[i, j] - loop.T @ inverse[later_i, later_j] @ loop
        assert np.linalg.eigvalsh(falls)[0] > 0.0


def test_the_gain_is_scheduled_with_convex_weights():
    """Between its two ends by α1, and at the nearer one outside; never beyond both."""
    bound = stage_law(stabiliser_gain=None).bind(CIRCLE, T)
    low, high = float(bound.low[0]), float(bound.high[0])
    first, last = (float(k) for k in bound.gain[:, 0, 0])
    assert first != last
    one, none = jnp.ones(1), jnp.zeros((1, 1))
    for alpha, wanted in (
        (low - 1.0, first), (low, first), (0.75 * low + 0.25 * high, 0.75 * first + 0.25 * last),
        (high, last), (high + 9.0, last),
    ):  # fmt: skip
        found = float(bound._gain(jnp.full(1, alpha), one, none)[0])
        assert_allclose(found, wanted, rtol=1e-12)


@pytest.mark.parametrize("gain", [None, GAIN], ids=["found", "given"])
def test_the_certified_range_is_watched(gain):
    law = stage_law(stabiliser_gain=gain, second_signal="position")
    bound = law.bind(CIRCLE, T)
    assert np.all(np.asarray(bound.certificate) > 0.0)
    if gain is None:  # a decay that is asked for is had with the least gain
        soft = replace(law, stabiliser_decay=0.9).bind(CIRCLE, T)
        assert np.all(np.abs(soft.gain) < 0.2 * np.abs(bound.gain))
        assert np.all(np.asarray(soft.radius) < 0.9)
    for signal, outside in (("position", True), ("best", False)):
        recording = cl.simulate(cao_zhang_stage(), replace(law, second_signal=signal), round_trip())
        assert np.any(np.asarray(recording["status"])[1000:] == 3) == outside


# -- the PID in the position domain ------------------------------------------------------------


def test_at_a_steady_master_it_is_the_pid_in_time():
    """Gains ki v and kd / v: the commands of the slave agree once the master moves steadily."""
    sine = Sinusoid(amplitude=1e-3, wavelength=6e-3, periods=3.0)
    reference = constant_rate(sine, rate=2e-3, duration=2.0, sample_time=T)
    law = PositionDomainPid(
        axis=stage_pid(), kp=11.34e3, ki=54.11e3 / 2e-3, kd=180.0 * 2e-3, master=0,
        least_speed=1e-5,
    )  # fmt: skip
    timed = np.asarray(cl.simulate(cao_zhang_stage(), stage_pid(), reference)["command"])
    found = np.asarray(cl.simulate(cao_zhang_stage(), law, reference)["command"])
    assert_allclose(found[1500:, 1], timed[1500:, 1], atol=0.02 * np.max(np.abs(timed[1500:, 1])))


DISC = Circle(radius=0.02, center=(0.01, -0.005))
MOVING = constant_rate(DISC, rate=34.0, duration=0.059, sample_time=T, start=0.5)
"""From 0.5 to 2.5 rad: the way does not change its sign, at which its derivative would jump."""


def every_gain(limit):
    """A PID of which every field matters."""
    return AxisPid(
        model=replace(model(limit=limit), coulomb=np.full(2, 0.3)), kp=3000.0, ki=4000.0, kd=6.0,
        derivative_cutoff_hz=80.0, velocity_feed_forward=0.9, acceleration_feed_forward=0.8,
        friction_feed_forward=0.6, friction_velocity=0.2,
    )  # fmt: skip


@pytest.mark.overnight
@pytest.mark.slow
def test_conformance_of_the_pid():
    check_controller(
        PositionDomainPid(
            axis=every_gain(1e5), kp=3000.0, ki=1e5, kd=0.5, master=0, least_speed=0.3,
            turning_width=0.2,
        ),
        contour=DISC, reference=MOVING,
    )  # fmt: skip


@pytest.mark.overnight
@pytest.mark.slow
def test_conformance_of_the_internal_model():
    """At 100 ms: inverting the axis takes second differences, whose rounding grows as 1 / T²."""
    reference = constant_rate(DISC, rate=0.34, duration=5.9, sample_time=0.1, start=0.5)
    check_controller(
        InternalModelContouring(
            axis=every_gain(1e6), master=0, stabiliser_gain=[-380.0, -250.0], turning_width=0.2,
            disturbance_observer_hz=0.6, disturbance_frequencies_hz=[1.0], second_signal="master",
            engage_time=0.45, observer_gain=0.05, master_observer_hz=0.8, compensate_master=False,
        ),
        contour=DISC, sample_time=0.1, reference=reference,
    )  # fmt: skip
