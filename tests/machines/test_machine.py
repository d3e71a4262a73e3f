"""Drives, encoders, tools and the machine that holds them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.configuration import replace, replace_at
from contourlab.errors import ConfigurationError
from contourlab.feedrate.limits import AxisLimits
from contourlab.machines import Drive, Encoder, LinearTool, Machine, NominalModel, RigidAxes

T = 1e-3


def machine(**parts):
    default = {
        "names": ("X", "Y"),
        "dynamics": RigidAxes(mass=(5.0, 3.0), viscous=20.0),
        "drive": Drive(command="force"),
    }
    return Machine(**(default | parts))


def run(m, commands, position=(0.0, 0.0), key=None, velocity=None):
    """Measurements at t_0, t_1, ... and the last state."""
    bound = m.bind(T)
    state = bound.init(position, key, velocity)
    advance = jax.jit(lambda state, command: bound.advance(state, command, jnp.zeros(m.n_axes)))
    seen = [bound.measure(state)]
    for command in commands:
        state = advance(state, jnp.broadcast_to(jnp.asarray(command, float), (m.n_axes,)))
        seen.append(bound.measure(state))
    return np.array([s.position for s in seen]), np.array([s.velocity for s in seen]), state


def test_command_acts_on_the_interval_that_begins_when_it_is_given():
    q, _, _ = run(machine(), [1.0, 0.0, 0.0])
    assert q[0, 0] == 0.0
    assert q[1, 0] > 0.0


@pytest.mark.parametrize("samples", [1, 3])
def test_delay_shifts_the_response_by_whole_samples(samples):
    u = [1.0, -2.0, 0.5, 0.0, 0.0, 0.0]
    now = run(machine(), u)[0]
    late = run(machine(drive=Drive(command="force", computing_delay=samples * T)), u)[0]
    assert np.array_equal(late[samples:], now[:-samples])
    assert np.all(late[: samples + 1] == 0.0)


def test_a_delay_that_is_a_multiple_to_rounding_is_one():
    assert Drive(command="force", computing_delay=3e-4).split(1e-4) == (3, (1.0,))
    assert Drive(command="force", computing_delay=0.3).split(0.1) == (3, (1.0,))
    waiting, parts = Drive(command="force", computing_delay=2.5e-3).split(1e-3)
    assert waiting == 3
    assert_allclose(parts, (0.5, 0.5))


def test_a_drive_clips_each_axis_at_its_own_limit():
    m = machine(drive=Drive(command="force", command_limit=(2.0, np.inf)))
    clipped = run(m, [[7.0, 7.0]] * 4)[0]
    assert np.array_equal(clipped, run(machine(), [[2.0, 7.0]] * 4)[0])
    assert np.array_equal(run(m, [[-7.0, 0.0]] * 4)[0], -run(machine(), [[2.0, 0.0]] * 4)[0])


def test_encoder_shows_the_nearest_count():
    m = machine(sensor=Encoder(resolution=(1e-6, 0.0)))
    q, _, _ = run(m, [5.0] * 20, position=(1.6e-6, 1.6e-6))
    assert_allclose(q[0], (2e-6, 1.6e-6), rtol=1e-12)
    assert_allclose(q[:, 0] / 1e-6, np.round(q[:, 0] / 1e-6), atol=1e-9)
    assert q[0, 1] % 1e-6 > 0


def test_velocity_is_the_difference_of_measured_positions():
    m = machine(sensor=Encoder(resolution=1e-6))
    q, v, _ = run(m, [50.0] * 20)
    assert_allclose(v[1:], np.diff(q, axis=0) / T, rtol=1e-12)
    assert np.all(v[0] == 0.0)
    assert np.array_equal(run(m, [], velocity=(0.1, 0.2))[1][0], (0.1, 0.2))


def test_ideal_velocity_is_the_true_one():
    m = machine(sensor=Encoder(resolution=1e-6, velocity="ideal"))
    _, v, state = run(m, [50.0] * 20)
    assert_allclose(v[-1], m.bind(T).true_velocity(state), rtol=1e-15)


def test_noise_comes_from_the_key():
    m = machine(sensor=Encoder(noise=(1e-6, 3e-6)))
    seen = run(m, np.zeros((400, 2)), key=3)[0]
    # 400 draws: the standard deviation is known to 3.5 %, four times that is allowed
    assert_allclose(seen.std(0), (1e-6, 3e-6), rtol=0.15)
    assert abs(np.corrcoef(seen.T)[0, 1]) < 0.2
    assert abs(np.corrcoef(seen[1:, 0], seen[:-1, 0])[0, 1]) < 0.2
    assert np.array_equal(seen, run(m, np.zeros((400, 2)), key=3)[0])
    assert np.array_equal(seen, run(m, np.zeros((400, 2)), key=jax.random.key(3))[0])
    assert not np.array_equal(seen, run(m, np.zeros((400, 2)), key=4)[0])
    with pytest.raises(ConfigurationError, match="random key or seed"):
        m.bind(T).init(jnp.zeros(2))


def test_rounding_lets_the_gradient_through():
    bound = machine(sensor=Encoder(resolution=1e-6)).bind(T)

    def seen(position):
        return bound.measure(bound.init(position)).position

    at = jnp.array((1.3e-6, -2.6e-6))
    assert_allclose(jax.jacrev(seen)(at), np.eye(2), rtol=1e-12)
    assert_allclose(jax.jacfwd(seen)(at), np.eye(2), rtol=1e-12)


def test_two_stages_and_a_planar_tool():
    """A stage with a scanner: four axes, a tool in the plane."""
    m = machine(
        names=("X", "Y", "U", "V"),
        dynamics=RigidAxes(mass=(20.0, 15.0, 0.1, 0.1), viscous=1.0),
        tool=LinearTool(matrix=((1, 0, 1, 0), (0, 1, 0, 1))),
    )
    bound = m.bind(T)
    state = bound.init((0.1, 0.2, 0.001, -0.002))
    assert_allclose(bound.tool_position(state), (0.101, 0.198), rtol=1e-15)
    assert m.tool.n_coordinates == 2
    with pytest.raises(ConfigurationError, match="one position per axis, 2, got 4"):
        machine(tool=m.tool)


def test_the_convenient_functions_do_the_same():
    m = machine(drive=Drive(command="force", computing_delay=1.5 * T))
    state = m.init((0.1, 0.2), dt=T)
    for command in ((1.0, 2.0), (3.0, -1.0), (0.0, 0.0)):
        state = m.advance(state, jnp.array(command), jnp.zeros(2), T)
    expected = run(m, [(1.0, 2.0), (3.0, -1.0), (0.0, 0.0)], position=(0.1, 0.2))[0][-1]
    assert_allclose(m.true_position(state), expected, rtol=1e-15)
    assert_allclose(m.measure(state).position, expected, rtol=1e-15)
    with pytest.raises(ConfigurationError, match="dt must be given"):
        m.init((0.1, 0.2))


def test_bind_is_traceable_over_numbers():
    m = machine()

    def end(mass, sample_time):
        bound = replace_at(m, "dynamics.mass", mass).bind(sample_time)
        state = bound.advance(bound.init(jnp.zeros(2)), jnp.ones(2), jnp.zeros(2))
        return bound.true_position(state)

    masses = jnp.array(((1.0, 2.0), (5.0, 3.0)))
    ends = jax.vmap(end, in_axes=(0, None))(masses, 1e-3)
    assert_allclose(ends[1], run(m, [1.0])[0][1], rtol=1e-13)
    assert_allclose(jax.jacfwd(end, argnums=1)(masses[0], 1e-3)[0], 1e-3, rtol=2e-2)  # t u / M
    late = replace_at(m, "drive.computing_delay", 1e-4)
    with pytest.raises(ConfigurationError, match="needs a sample time that is a number"):
        jax.jit(lambda t: late.bind(t).n_waiting)(1e-3)


LIMITS = {"velocity": np.ones(3), "acceleration": np.ones(3), "jerk": np.ones(3)}
NOMINAL = NominalModel(
    mass=np.ones(3), viscous=np.ones(3), coulomb=np.ones(3), gain=np.ones(3),
    command_limit=np.ones(3), command="force",
)  # fmt: skip
TWO = NominalModel(
    mass=np.ones(2), viscous=np.ones(2), coulomb=np.ones(2), gain=np.ones(2),
    command_limit=np.ones(2), command="voltage",
)  # fmt: skip


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"travel": ((0.1, -0.1), (0, 1))}, "travel of axis X must have lower < upper, got 0.1 to"),
        ({"travel": ((0.0, 0.1),) * 3}, r"travel must .*\(2, 2\), got \(3, 2\)"),
        ({"names": ()}, "names must name one axis"),
        ({"names": ("X", "X")}, "names must differ"),
        ({"drive": Drive(command="force", command_limit=(1.0,) * 3)}, "command_limit .* 2, got 3"),
        ({"sensor": Encoder(resolution=(1.0,) * 3)}, "resolution .* 2, got 3"),
        ({"sensor": Encoder(noise=(1.0,) * 3)}, "noise .* 2, got 3"),
        ({"limits": AxisLimits(**LIMITS)}, "limits.velocity .* 2, got 3"),
        ({"nominal_model": NOMINAL}, "nominal_model .* 2, got 3"),
        ({"nominal_model": TWO}, "drive's command, force, got voltage"),
        ({"substeps": 0}, "substeps must be a whole number >= 1, got 0"),
    ],
)  # fmt: skip
def test_parts_that_do_not_fit_are_named(parts, words):
    with pytest.raises(ConfigurationError, match=words):
        machine(**parts)


def test_wrong_parts_are_named():
    with pytest.raises(ConfigurationError, match=r"computing_delay must be >= 0 s .* got -0.001"):
        Drive(command="force", computing_delay=-1e-3)
    with pytest.raises(ConfigurationError, match="command_limit must be > 0, got -1"):
        Drive(command="force", command_limit=-1.0)
    with pytest.raises(ConfigurationError, match="resolution must be >= 0 m"):
        Encoder(resolution=-1e-6)
    with pytest.raises(ConfigurationError, match="sample_time must be > 0 s, got 0"):
        machine().bind(0.0)
    with pytest.raises(ConfigurationError, match=r"position must .*\(2,\), got \(3,\)"):
        machine().bind(T).init(jnp.zeros(3))


def test_a_nominal_model_replaces_the_truth():
    told = replace(TWO, command="force")
    assert machine(nominal_model=told).nominal is told
