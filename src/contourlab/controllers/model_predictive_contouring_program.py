"""The quadratic program of one sample of predictive contouring, in scaled deviations from a plan.

The plan is rolled out from the present state with the inputs of the last one, so that deviations
start at 0 and obey the model without a remainder. Units: the speed limit V for velocities, V T for
positions and progress, the command limit (or, without one, the command that holds V) for commands,
and the reward of one sample at full speed for the cost. Weights may then span decades and units be
metres without harm. Of a state the program sees

    x_j = (q, v, s, w before),    u_j = w = (commands, path speed),    j = 0 .. N.

Of the error e = p(s) - q and the tangent t it takes the lag t' e and the contour error e - lag t,
with their first derivatives, the contour's curvature κ N among them:

    d lag = -t' dq + (1 + κ N' e) ds,     d contour = -(I - t t') dq - κ N lag ds.            (1)
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.controllers.held_model import HeldAxes
from contourlab.controllers.model_predictive_contouring_path import PathPoint, tangent_normals
from contourlab.controllers.model_predictive_contouring_reserve import (
    reserve_commands,
    reserve_rows,
)
from contourlab.controllers.model_predictive_contouring_speed import SafeSpeed
from contourlab.controllers.quadratic_program_stages import Dynamics, Rows, StagedProgram
from contourlab.typing import Array, AxisVector, Flag, Scalar

__all__ = ["ContouringProgram", "Limits", "Plan", "Weights", "command_ranges"]

EXCEEDED = 1e-3
"""Share of a soft limit from which on it counts as exceeded."""
OVERSPEED = 1e-2
"""Share of v_max by which the speed that is safe at the end of the plan is missed, likewise."""
HALF, WITHIN = 0.5**0.5, 0.9238795325112867
"""cos(π/4), and cos(π/8): an octagon's flats over its corners."""


class Weights(eqx.Module):
    """Of the cost, in SI, per sample."""

    contour: Scalar
    """[1/m²]"""
    lag: Scalar
    """[1/m²]"""
    reward: Scalar
    """[s/m]"""
    change: Float[Array, " n_inputs"]
    """Of a change of each input over a sample: commands [1/command²], path speed [s²/m²]."""


class Limits(eqx.Module):
    """What must hold; None where there is no such limit."""

    command: AxisVector
    """May be infinite."""
    speed: Scalar
    """Path speed [m/s]."""
    command_step: AxisVector | None
    """Change of a command over a sample."""
    velocity: AxisVector | None
    """[m/s]"""
    acceleration: AxisVector | None
    """[m/s²]"""
    contour_error: Scalar | None
    """[m]"""
    braking: Scalar
    """Deceleration that every axis can give [m/s²]; may be infinite."""
    penalty: Scalar
    """Of exceeding a soft limit by itself, in rewards of one sample at full speed."""


def command_ranges(axes: HeldAxes, limits: Limits) -> Array:
    """Return how large commands may be, or, where there is no limit, what is ample.

    Parameters
    ----------
    axes
        The held model.
    limits
        Those of commands and speed count.
    """
    # what brings an axis to the speed limit in ten samples
    ample = 0.1 * limits.speed / axes.velocity_from_command
    bounded = jnp.isfinite(limits.command)
    return jnp.where(bounded, jnp.where(bounded, limits.command, 1.0), ample)


class Plan(NamedTuple):
    """A motion over the horizon, in SI."""

    positions: Float[Array, "n_stages_plus_one n_axes"]
    velocities: Float[Array, "n_stages_plus_one n_axes"]
    progress: Float[Array, " n_stages_plus_one"]
    inputs: Float[Array, "n_stages n_inputs"]


class AxesDynamics(Dynamics):
    """From (q, v, s, w before) and w to the next, in scaled units."""

    axes: HeldAxes

    @property
    def n_states(self) -> int:
        """Length of x."""
        return 3 * len(self.axes.position_from_position) + 2

    def ahead(self, y: Array) -> Array:
        """Return x of the next stage, shape (n_x,).

        Parameters
        ----------
        y
            x and w, shape (n_y,).
        """
        n, n_x = len(self.axes.position_from_position), self.n_states
        w = y[n_x:]
        q, v = self.axes.after(y[:n], y[n : 2 * n], w[:n])
        # scaled, a sample's way at full speed is 1
        return jnp.concatenate([q, v, y[2 * n : 2 * n + 1] + w[n:], w])

    def back(self, x: Array) -> Array:
        """Return D' x, shape (n_y, ...).

        Parameters
        ----------
        x
            Shape (n_x, ...).
        """
        n, a = len(self.axes.position_from_position), self.axes
        q, v, s, w = x[:n], x[n : 2 * n], x[2 * n : 2 * n + 1], x[2 * n + 1 :]

        def times(one: Array, other: Array) -> Array:
            shape = (n,) + (1,) * (x.ndim - 1)
            return one.reshape(shape) * q + other.reshape(shape) * v

        return jnp.concatenate([
            times(a.position_from_position, a.velocity_from_position),
            times(a.position_from_velocity, a.velocity_from_velocity),
            s, jnp.zeros_like(w),
            times(a.position_from_command, a.velocity_from_command) + w[:n],
            s + w[n:],
        ])  # fmt: skip


class ContouringProgram(eqx.Module):
    """Makes plans by rolling out, programs around plans, and plans of their solutions."""

    axes: HeldAxes
    weights: Weights
    limits: Limits
    sample_time: Scalar
    n_stages: int = eqx.field(static=True)
    heavy: HeldAxes | None = None
    """The axes of the mass that a reserve of the command is kept for; None keeps none."""

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return int(self.limits.command.shape[0])

    @property
    def input_scale(self) -> Array:
        """Units of commands and path speed, shape (n_inputs,)."""
        return jnp.append(command_ranges(self.axes, self.limits), self.limits.speed)

    @property
    def state_scale(self) -> Array:
        """Units of positions, velocities, progress and the inputs before."""
        n, speed = self.n_axes, self.limits.speed
        length = speed * self.sample_time
        return jnp.concatenate(
            [jnp.full(n, length), jnp.full(n, speed), jnp.full(1, length), self.input_scale]
        )

    def roll_out(
        self, position: AxisVector, velocity: AxisVector, progress: Scalar, inputs: Array,
        disturbance: Array,
    ) -> Plan:  # fmt: skip
        """Return the plan that inputs lead to.

        Parameters
        ----------
        position, velocity, progress
            At the start.
        inputs
            Shape (n_stages, n_inputs).
        disturbance
            In units of the command, shape (n_stages, n_axes).
        """
        n = self.n_axes

        def stage(carry: Any, here: Any) -> tuple[Any, Any]:
            q, v, s = carry
            w, d = here
            q, v = self.axes.after(q, v, w[:n] + d)
            after = q, v, s + self.sample_time * w[n]
            return after, after

        first: tuple[Any, ...] = (position, velocity, jnp.asarray(progress))
        _, rest = jax.lax.scan(stage, first, (inputs, disturbance))
        q, v, s = (jnp.concatenate([a[None], b]) for a, b in zip(first, rest, strict=True))
        return Plan(q, v, s, inputs)

    def program(
        self, plan: Plan, path: PathPoint, before: Array, end: Scalar,
        safe: SafeSpeed | None = None, disturbance: Array | None = None,
    ) -> StagedProgram:  # fmt: skip
        """Return the program around a plan.

        Parameters
        ----------
        plan
            As ``roll_out`` made it.
        path
            The contour at its progress from stage 1 on, n_stages points.
        before
            The inputs of the sample before, shape (n_inputs,).
        end
            Progress at which to stop [m].
        safe
            How fast the axes may be; any speed if not given.
        disturbance
            Of the heavy axes, in units of the command, shape (n_stages, n_axes); none if not
            given.
        """
        hessians, gradients = jax.vmap(self._errors)(plan.positions[1:], path)
        change, slopes = self._changes(plan.inputs, before)
        scale = self.input_scale
        top = jnp.append(self.limits.command, self.limits.speed)
        bottom = jnp.append(-self.limits.command, 0.0)
        return StagedProgram(
            state_hessian=hessians, state_gradient=gradients, stage_hessian=change,
            stage_gradient=slopes, dynamics=self._dynamics(),
            start=jnp.zeros(3 * self.n_axes + 2),
            lower=(bottom - plan.inputs) / scale, upper=(top - plan.inputs) / scale,
            rows=self._rows(plan, path, before, end, safe, disturbance),
        )  # fmt: skip

    def moved(self, plan: Plan, states: Array, inputs: Array) -> Plan:
        """Return the plan moved by a solution.

        Parameters
        ----------
        plan
            That the program was made around.
        states, inputs
            Of the solution.
        """
        n = self.n_axes
        x = states * self.state_scale
        return Plan(
            plan.positions + x[:, :n], plan.velocities + x[:, n : 2 * n],
            plan.progress + x[:, 2 * n], plan.inputs + inputs * self.input_scale,
        )  # fmt: skip

    def exceeded(
        self, program: StagedProgram, excess: Array, before: Plan, after: Plan, path: PathPoint
    ) -> Flag:
        """Return whether a solution exceeds a soft limit, by a share of it.

        Of speeds those count that the last stage must have; at corners they only guide.

        Parameters
        ----------
        program, excess
            The program, and e of its solution.
        before, after
            The plan that it was made around, and that of the solution.
        path
            The contour at the stages of ``before``.
        """
        t = path.tangent[-1]
        now = jnp.maximum(t @ before.velocities[-1], 0.0)
        turned = t @ (after.velocities - before.velocities)[-1]
        square = jnp.maximum(now**2 + 2.0 * now * turned, 0.0)
        over = jnp.zeros((), bool)
        soft = [rows for rows in program.rows if rows.penalty is not None]
        for rows, part in zip(soft, program.soft_parts(excess), strict=True):
            if rows.lower is not None:
                over = over | (jnp.max(part) > EXCEEDED)
            elif rows.over == "end":
                # of the square of a speed: what is left of it without the excess is the limit's
                allowed = jnp.sqrt(jnp.maximum(square - self._square * jnp.max(part), 0.0))
                over = over | (jnp.sqrt(square) - allowed > OVERSPEED * self.limits.speed)
        return over

    def _dynamics(self) -> AxesDynamics:
        n, a = self.n_axes, self.axes
        q, v = self.state_scale[:n], self.state_scale[n : 2 * n]
        u = self.input_scale[:n]
        return AxesDynamics(HeldAxes(
            a.position_from_position, a.position_from_velocity * v / q,
            a.velocity_from_position * q / v, a.velocity_from_velocity,
            a.position_from_command * u / q, a.velocity_from_command * u / v,
        ))  # fmt: skip

    @property
    def _square(self) -> Array:
        """Unit of squares of speeds [m²/s²]: at full speed, or lost by braking over a sample."""
        speed, braking = self.limits.speed, jnp.asarray(self.limits.braking)
        braking = jnp.where(jnp.isfinite(braking), braking, 0.0)
        return jnp.asarray(speed**2 + 2.0 * braking * speed * self.sample_time)

    @property
    def _unit(self) -> Array:
        """Cost that counts as 1: the reward of one sample at full speed."""
        return jnp.asarray(self.weights.reward * self.limits.speed)

    def _errors(self, position: AxisVector, path: PathPoint) -> tuple[Array, Array]:
        """Return Hessian and gradient over (q, v, s) of the cost of errors at one stage."""
        n, length = self.n_axes, self.limits.speed * self.sample_time
        t = path.tangent
        e = (path.position - position) / length
        bend = path.bend * length
        lag = t @ e
        across = e - t * lag
        still = jnp.zeros(n)  # velocities do not count
        d_lag = jnp.concatenate([-t, still, (1.0 + bend @ e)[None]])  # (1)
        d_across = jnp.concatenate(
            [t[:, None] * t - jnp.eye(n), jnp.zeros((n, n)), -bend[:, None] * lag], axis=1
        )
        size = 2.0 * length**2 / self._unit
        contour, along = size * self.weights.contour, size * self.weights.lag
        hessian = contour * d_across.T @ d_across + along * d_lag[:, None] * d_lag
        return hessian, contour * across @ d_across + along * lag * d_lag

    def _changes(self, inputs: Array, before: Array) -> tuple[Array, Array]:
        """Return Hessian (of every stage) and gradients over y of changes of inputs and reward."""
        m = self.n_axes + 1
        scale = self.input_scale
        r = 2.0 * self.weights.change * scale**2 / self._unit
        n_x = 2 * self.n_axes + 1 + m
        difference = jnp.zeros((m, n_x + m))
        j = jnp.arange(m)
        difference = difference.at[j, n_x - m + j].set(-1.0).at[j, n_x + j].set(1.0)
        change = (inputs - jnp.concatenate([before[None], inputs[:-1]])) / scale
        slopes = jnp.asarray((r * change) @ difference)
        return difference.T @ (r[:, None] * difference), slopes.at[:, -1].add(-1.0)

    def _rows(
        self, plan: Plan, path: PathPoint, before: Array, end: Scalar, safe: SafeSpeed | None,
        disturbance: Array | None,
    ) -> tuple[Rows, ...]:  # fmt: skip
        """Return the rows of deviations, with what is left to their limits."""
        n, limits = self.n_axes, self.limits
        n_x = 3 * n + 2
        scale, length = self.input_scale, limits.speed * self.sample_time
        dynamics = self._dynamics()
        pick = jnp.eye(n_x + n + 1)
        found: list[Rows] = []

        def add(over: str, normals: Array, value: Array, *, both: bool, soft: bool) -> None:
            # normals give the deviation of a value whose limit is 1, or 0 if there is one side
            normals = jnp.broadcast_to(normals, (*value.shape, normals.shape[-1]))
            penalty = jnp.broadcast_to(limits.penalty, value.shape[-1:]) if soft else None
            upper, lower = (1.0 - value, -1.0 - value) if both else (-value, None)
            found.append(Rows(over, normals, upper, lower, penalty))

        if limits.command_step is not None:
            step = limits.command_step
            last = jnp.concatenate([before[None], plan.inputs[:-1]])
            now, then = pick[n_x : n_x + n], pick[n_x - n - 1 : n_x - 1]
            rows = (scale[:n] / step)[:, None] * (now - then)
            add("stage", rows, (plan.inputs - last)[:, :n] / step, both=True, soft=False)
        if limits.velocity is not None:
            ratio = limits.speed / limits.velocity
            rows = ratio[:, None] * jnp.eye(2 * n)[n:]
            add("state", rows, plan.velocities[1:] / limits.velocity, both=True, soft=True)
        following = dynamics.back(jnp.eye(n_x))[:, n : 2 * n].T
        if limits.acceleration is not None:
            most = limits.acceleration * self.sample_time
            rows = (limits.speed / most)[:, None] * (following - pick[n : 2 * n])
            add("stage", rows, jnp.diff(plan.velocities, axis=0) / most, both=True, soft=True)
        if self.heavy is not None:
            command = reserve_commands(
                self.heavy, plan.positions, plan.velocities,
                jnp.zeros(n) if disturbance is None else disturbance,
            )  # fmt: skip
            rows = reserve_rows(
                self.heavy, limits.speed * following, length * pick[:n],
                limits.speed * pick[n : 2 * n], limits.command,
            )  # fmt: skip
            ahead = (jnp.arange(self.n_stages) > 0)[:, None]  # what is applied may use the limit
            rows = jnp.where(ahead[:, :, None], rows, 0.0)
            used = jnp.where(ahead, command / limits.command, 0.0)
            add("stage", rows, used, both=True, soft=True)
        if limits.contour_error is not None:
            add("state", *self._tube(plan, path), both=True, soft=True)
        # every stage is before the last
        room = (end - plan.progress[-1:]) / length
        add("end", pick[2 * n : 2 * n + 1, : 2 * n + 1], -room, both=False, soft=False)
        a = jnp.asarray(limits.braking)
        last_point = jax.tree.map(lambda x: x[-1], path)
        # able to stop: (t' v)² <= 2 a (end - s)
        squares: list[tuple[Scalar, Scalar]] = [(2.0 * a * (end - plan.progress[-1]), -2.0 * a)]
        if safe is not None:
            squares.append(safe.at(safe.everything, plan.progress[-1], last_point.piece))
        at_end = [self._speed(plan.velocities[-1], last_point, *square) for square in squares]
        normals, values = (jnp.stack(part) for part in zip(*at_end, strict=True))
        add("end", normals, values, both=False, soft=True)
        if safe is not None:
            corners = jax.vmap(lambda s, k: safe.at(safe.corners, s, k))(
                plan.progress[1:], path.piece
            )
            rows, value = jax.vmap(self._speed)(plan.velocities[1:], path, *corners)
            add("state", rows[:, None], value[:, None], both=False, soft=True)
        return tuple(found)

    def _tube(self, plan: Plan, path: PathPoint) -> tuple[Array, Array]:
        """Return the rows of the error in every direction of the path's frame.

        Across the path it is the contour error. Along it is the lag, which is bounded too: the
        frame jumps at a corner, and what was across is along it then.
        """
        n = self.n_axes
        limit, length = jnp.asarray(self.limits.contour_error), self.limits.speed * self.sample_time
        across = jax.vmap(tangent_normals)(path.tangent)
        room = jnp.stack([limit] * n)
        if n == 3:  # an octagon within the circle
            one, two = across[:, :1], across[:, 1:]
            across = jnp.concatenate([across, HALF * (one + two), HALF * (one - two)], axis=1)
            room = jnp.concatenate([limit[None], jnp.stack([limit * WITHIN] * 4)])
        frame = jnp.concatenate([path.tangent[:, None], across], axis=1)
        e = path.position - plan.positions[1:]
        value = jnp.sum(frame * e[:, None], axis=2)
        turn = jnp.sum(frame * path.bend[:, None], axis=2) * value[:, :1]  # of the tangent: 0
        along = 1.0 + jnp.sum(path.bend * e, axis=1)
        slope = jnp.concatenate([along[:, None] - turn[:, :1], -turn[:, 1:]], axis=1)
        rows = jnp.concatenate([-frame, jnp.zeros_like(frame), slope[:, :, None]], axis=2)  # (1)
        return length / room[:, None] * rows, value / room

    def _speed(
        self, velocity: AxisVector, path: PathPoint, square: Scalar, slope: Scalar
    ) -> tuple[Array, Array]:
        """Return the row over (q, v, s) of (t' v)² <= square + slope ds at one stage."""
        n, speed = self.n_axes, self.limits.speed
        bounded = jnp.isfinite(square) & jnp.isfinite(slope)
        square, slope = jnp.where(bounded, square, 1.0), jnp.where(bounded, slope, 0.0)
        t = path.tangent
        now = jnp.maximum(t @ velocity, 0.0)
        length, size = speed * self.sample_time, self._square
        row = jnp.concatenate([jnp.zeros(n), 2.0 * speed * now * t, (-slope * length)[None]]) / size
        return row, jnp.where(bounded, (now**2 - square) / size, -jnp.inf)
