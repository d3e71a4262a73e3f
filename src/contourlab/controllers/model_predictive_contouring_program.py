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
from contourlab.controllers.model_predictive_contouring_speed import SafeSpeed
from contourlab.controllers.quadratic_program import StagedProgram
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["ContouringProgram", "Limits", "Plan", "Weights"]


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


class Plan(NamedTuple):
    """A motion over the horizon, in SI."""

    positions: Float[Array, "n_stages_plus_one n_axes"]
    velocities: Float[Array, "n_stages_plus_one n_axes"]
    progress: Float[Array, " n_stages_plus_one"]
    inputs: Float[Array, "n_stages n_inputs"]


class ContouringProgram(eqx.Module):
    """Makes plans by rolling out, programs around plans, and plans of their solutions."""

    axes: HeldAxes
    weights: Weights
    limits: Limits
    sample_time: Scalar
    n_stages: int = eqx.field(static=True)

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return int(self.limits.command.shape[0])

    @property
    def input_scale(self) -> Array:
        """Units of commands and path speed, shape (n_inputs,)."""
        limit, speed = self.limits.command, self.limits.speed
        # what brings an axis to the speed limit in ten samples
        ample = 0.1 * speed / self.axes.velocity_from_command
        bounded = jnp.isfinite(limit)
        commands = jnp.where(bounded, jnp.where(bounded, limit, 1.0), ample)
        return jnp.append(commands, speed)

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
        safe: SafeSpeed | None = None,
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
        """
        dynamics = self._dynamics()
        n_x, n_y = dynamics.shape
        hessians, gradients = jax.vmap(self._errors)(plan.positions[1:], path)
        change, slopes = self._changes(plan.inputs, before)
        pad = n_y - n_x
        first = jnp.zeros((1, n_x, n_x)), jnp.zeros((1, n_x))
        on_states = jnp.concatenate([first[0], hessians[:-1]])
        hessian = jnp.pad(on_states, ((0, 0), (0, pad), (0, pad))) + change
        gradient = jnp.pad(jnp.concatenate([first[1], gradients[:-1]]), ((0, 0), (0, pad)))
        rows, lower, upper, penalty = self._rows(plan, path, before, end, dynamics, safe)
        return StagedProgram(
            hessian=hessian, gradient=gradient + slopes, terminal_hessian=hessians[-1],
            terminal_gradient=gradients[-1], dynamics=dynamics, start=jnp.zeros(n_x),
            rows=rows, lower=lower, upper=upper, penalty=penalty,
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

    def _dynamics(self) -> Array:
        n, a = self.n_axes, self.axes
        q, v, s, w = 0, n, 2 * n, 2 * n + 1
        n_x = 3 * n + 2
        d = jnp.zeros((n_x, n_x + n + 1))
        i = jnp.arange(n)
        d = d.at[q + i, q + i].set(a.position_from_position)
        d = d.at[q + i, v + i].set(a.position_from_velocity)
        d = d.at[q + i, n_x + i].set(a.position_from_command)
        d = d.at[v + i, q + i].set(a.velocity_from_position)
        d = d.at[v + i, v + i].set(a.velocity_from_velocity)
        d = d.at[v + i, n_x + i].set(a.velocity_from_command)
        d = d.at[s, s].set(1.0).at[s, n_x + n].set(self.sample_time)
        j = jnp.arange(n + 1)
        d = d.at[w + j, n_x + j].set(1.0)
        scale = self.state_scale
        return d * jnp.concatenate([scale, self.input_scale]) / scale[:, None]

    @property
    def _unit(self) -> Array:
        """Cost that counts as 1: the reward of one sample at full speed."""
        return jnp.asarray(self.weights.reward * self.limits.speed)

    def _errors(self, position: AxisVector, path: PathPoint) -> tuple[Array, Array]:
        """Return Hessian and gradient over x of the cost of errors at one stage."""
        n, length = self.n_axes, self.limits.speed * self.sample_time
        t = path.tangent
        e = (path.position - position) / length
        bend = path.bend * length
        lag = t @ e
        across = e - t * lag
        n_x = 3 * n + 2
        d_lag = jnp.zeros(n_x).at[:n].set(-t).at[2 * n].set(1.0 + bend @ e)  # (1)
        d_across = (
            jnp.zeros((n, n_x)).at[:, :n].set(t[:, None] * t - jnp.eye(n)).at[:, 2 * n]
            .set(-bend * lag)
        )  # fmt: skip
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
        self, plan: Plan, path: PathPoint, before: Array, end: Scalar, dynamics: Array,
        safe: SafeSpeed | None,
    ) -> tuple[Array, Array, Array, Array]:  # fmt: skip
        """Return rows over y with their bounds, (N, n_rows, n_y), and penalties."""
        n, limits, big = self.n_axes, self.limits, self.n_stages
        n_x, n_y = dynamics.shape
        m = n + 1
        scale = self.input_scale
        pick = jnp.eye(n_y)
        inputs = plan.inputs / scale
        found: list[tuple[Array, Array, Array, Array]] = []

        def add(rows: Array, value: Array, lower: Array, upper: Array, penalty: Array) -> None:
            # rows give the deviation of a value; bounds are of the value, shape (N, k)
            k = value.shape[1]
            found.append((
                jnp.broadcast_to(rows, (big, k, n_y)), lower - value, upper - value,
                jnp.broadcast_to(penalty, (k,)),
            ))  # fmt: skip

        hard, soft = jnp.asarray(jnp.inf), jnp.asarray(limits.penalty)
        top = jnp.append(limits.command, limits.speed) / scale
        add(pick[n_x:], inputs, jnp.append(-top[:n], 0.0), top, hard)
        if limits.command_step is not None:
            step = limits.command_step / scale[:n]
            last = jnp.concatenate([before[None], plan.inputs[:-1]]) / scale
            rows = pick[n_x : n_x + n] - pick[n_x - m : n_x - 1]
            add(rows, (inputs - last)[:, :n], -step, step, hard)
        following = dynamics[n : 2 * n]  # velocities one sample later
        if limits.velocity is not None:
            ratio = limits.speed / limits.velocity
            value = plan.velocities[1:] / limits.velocity
            one = jnp.ones(n)
            add(ratio[:, None] * following, value, -one, one, soft)
        if limits.acceleration is not None:
            ratio = limits.speed / (limits.acceleration * self.sample_time)
            value = jnp.diff(plan.velocities, axis=0) / (limits.acceleration * self.sample_time)
            one = jnp.ones(n)
            add(ratio[:, None] * (following - pick[n : 2 * n]), value, -one, one, soft)
        if limits.contour_error is not None:
            add(*self._tube(plan, path, dynamics), soft)
        unbounded = jnp.full((big, 1), jnp.inf)
        length = limits.speed * self.sample_time
        room = ((end - plan.progress[1:]) / length)[:, None]
        # every stage is before the last
        add(dynamics[2 * n][None], 0.0 * room, -unbounded, unbounded.at[-1].set(room[-1]), hard)
        a = jnp.asarray(limits.braking)
        # able to stop: (t' v)² <= 2 a (end - s)
        add(
            *self._last_speed(plan, path, 2.0 * a * (end - plan.progress[-1]), -2.0 * a, dynamics),
            soft,
        )
        if safe is not None:
            square, slope = safe.at(safe.everything, plan.progress[-1])
            add(*self._last_speed(plan, path, square, slope, dynamics), soft)
            corners = jax.vmap(lambda s: safe.at(safe.corners, s))(plan.progress[1:])
            add(*self._speeds(plan, path, *corners, dynamics), soft)
        columns = [list(column) for column in zip(*found, strict=True)]
        rows, lower, upper = (jnp.concatenate(column, axis=1) for column in columns[:3])
        return rows, lower, upper, jnp.concatenate(columns[3])

    def _tube(
        self, plan: Plan, path: PathPoint, dynamics: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return the rows of the error in every direction of the path's frame.

        Across the path it is the contour error. Along it is the lag, which is bounded too: the
        frame jumps at a corner, and what was across is along it then.
        """
        n = self.n_axes
        limit, length = jnp.asarray(self.limits.contour_error), self.limits.speed * self.sample_time
        frame = jnp.concatenate(
            [path.tangent[:, None], jax.vmap(tangent_normals)(path.tangent)], axis=1
        )
        e = path.position - plan.positions[1:]
        value = jnp.einsum("jkn,jn->jk", frame, e) / limit
        lag = value[:, :1] * limit
        turn = jnp.einsum("jkn,jn->jk", frame, path.bend) * lag  # of the tangent: 0
        along = jnp.zeros(n).at[0].set(1.0) * (1.0 + jnp.sum(path.bend * e, axis=1))[:, None]
        over_x = jnp.zeros((self.n_stages, n, dynamics.shape[0]))
        over_x = over_x.at[:, :, :n].set(-frame).at[:, :, 2 * n].set(along - turn)  # (1)
        one = jnp.ones(n)
        return (length / limit) * over_x @ dynamics, value, -one, one

    def _last_speed(
        self, plan: Plan, path: PathPoint, square: Array, slope: Array, dynamics: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return the row of (t' v)² <= square + slope ds at the last stage alone."""
        last = jnp.arange(self.n_stages) == self.n_stages - 1
        slopes = jnp.full(self.n_stages, slope)
        return self._speeds(plan, path, jnp.where(last, square, jnp.inf), slopes, dynamics)

    def _speeds(
        self, plan: Plan, path: PathPoint, square: Array, slope: Array, dynamics: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return the row of (t' v)² <= square + slope ds at every stage, about the plan."""
        n, speed = self.n_axes, self.limits.speed
        bounded = jnp.isfinite(square) & jnp.isfinite(slope)
        square, slope = jnp.where(bounded, square, 1.0), jnp.where(bounded, slope, 0.0)
        t = path.tangent
        now = jnp.maximum(jnp.sum(t * plan.velocities[1:], axis=1), 0.0)
        length = speed * self.sample_time
        size = speed**2 + jnp.abs(slope) * length
        over_x = jnp.zeros((self.n_stages, dynamics.shape[0]))
        over_x = over_x.at[:, n : 2 * n].set(2.0 * speed * now[:, None] * t)
        over_x = over_x.at[:, 2 * n].set(-slope * length)
        rows = (over_x @ dynamics) / size[:, None]
        value = ((now**2 - square) / size)[:, None]
        top = jnp.where(bounded, 0.0, jnp.inf)[:, None]
        return rows[:, None], value, jnp.full_like(value, -jnp.inf), top
