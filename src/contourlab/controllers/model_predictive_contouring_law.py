"""The law of model predictive contouring, sample by sample.

At each sample: what the observer believes now, the last plan rolled out from there, the quadratic
program about that plan, its solution as the new plan, and its first command. What is kept is the
rest of the plan and the multipliers, moved on by a stage.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.controllers.base import BoundController
from contourlab.controllers.model_predictive_contouring_axes import Observed, Observer
from contourlab.controllers.model_predictive_contouring_path import ProgressPath
from contourlab.controllers.model_predictive_contouring_program import ContouringProgram, Plan
from contourlab.controllers.model_predictive_contouring_speed import SafeSpeed
from contourlab.controllers.quadratic_program import solve_program
from contourlab.controllers.quadratic_program_stages import StagedProgram
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Flag, Scalar

__all__ = ["BoundModelPredictiveContouring", "PredictiveState"]


class PredictiveState(NamedTuple):
    """What the law remembers."""

    observed: Observed
    """Expected of the axes at the next sample."""
    progress: Scalar
    """s at the next sample [m]."""
    end: Scalar
    """s at which to stop [m]."""
    goal: Scalar
    """s of the end of the path [m]."""
    inputs: Array
    """The plan from the next sample on, (n_stages, n_inputs)."""
    velocities: Array
    """Planned with it, (n_stages, n_axes)."""
    applied: Array
    """The last inputs, (n_inputs,)."""
    multipliers: Array
    """Of the last solution, shifted; zeros after none."""
    piece: Count
    """Of the contour, where the last plan began."""
    error: AxisVector
    """From the tool to the contour, as believed at the last sample [m]."""
    iterations: Count
    lost: Count
    """Samples in a row without a measurement; it stays once they are too many."""
    status: Count
    arrived: Count
    """1 if it stands at the end; int32."""
    heavy: Observed | None
    """As ``observed``, of the mass that a reserve is kept for; None if none is kept."""


class BoundModelPredictiveContouring(BoundController):
    """The discretised law; made by ``ModelPredictiveContouring.bind``."""

    path: ProgressPath = part()
    safe: SafeSpeed = part()
    observer: Observer = part()
    heavy: Observer | None = part()
    """Of the mass that a reserve of the command is kept for."""
    planner: ContouringProgram = part()
    friction: Float[Array, " ..."] = real(unit="command unit", ndim=1)
    """Command against Coulomb friction."""
    friction_velocity: Float[Array, " ..."] = real(unit="m/s", ndim=1)
    arrival_tolerance: Scalar = real(unit="m")
    passes: int = static()
    max_iterations: int = static()
    lost_samples: int = static()

    statuses = (
        "normal",
        "a limit is exceeded in the plan",
        "measurement not finite, the model's taken",
        "no solution found, the last plan goes on",
        "too many measurements not finite, stopped on the path",
    )

    def init(self, sample: Sample) -> PredictiveState:
        """Return the state before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        n, big = self.planner.n_axes, self.planner.n_stages
        zero = jnp.zeros_like(sample.position)
        start = self.path.progress(sample.reference.parameter)
        turns = jnp.floor(start / self.path.length) if self.path.contour.closed else 0.0
        start = start - turns * self.path.length
        end = start + self.path.length if self.path.contour.closed else self.path.length
        inputs = jnp.zeros((big, n + 1))
        whole = jnp.zeros((), jnp.int32)
        points = self.path.points(jnp.full(big, start), whole)
        shape = jax.eval_shape(
            lambda: self.planner.program(
                Plan(jnp.zeros((big + 1, n)), jnp.zeros((big + 1, n)), jnp.zeros(big + 1), inputs),
                points, jnp.zeros(n + 1), end, self.safe,
            ).bounds()[0]
        ).shape  # fmt: skip
        # a first measurement that is lost would be with the observer for ever
        known = jnp.isfinite(sample.position)
        position = jnp.where(known, sample.position, sample.reference.position)
        return PredictiveState(
            Observed(position, zero, zero), start, jnp.asarray(end), jnp.asarray(end), inputs,
            jnp.zeros((big, n)), jnp.zeros(n + 1), jnp.zeros(shape), jnp.asarray(points.piece)[0],
            zero, whole, whole, whole, whole,
            None if self.heavy is None else Observed(position, zero, zero),
        )  # fmt: skip

    def step(self, state: PredictiveState, sample: Sample) -> tuple[AxisVector, PredictiveState]:
        """Return the command, shape (n_axes,), and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant; its position, and at the start the reference's parameter.
        """
        planner, n = self.planner, self.planner.n_axes
        now, plan, friction = self._before(state, sample)
        heavy, reserved = self._heavy(state, sample, friction)
        lost, end = self._lost(state, sample)
        blind = lost >= self.lost_samples
        piece = state.piece
        kept = plan
        multipliers = state.multipliers
        good: Array = jnp.ones((), bool)
        over: Flag = jnp.zeros((), bool)
        iterations: Array = jnp.zeros((), jnp.int32)
        here: Any = None
        program: Any = None
        for _ in range(self.passes):
            points = self.path.points(plan.progress, piece)
            piece = jnp.asarray(points.piece)[0]
            here = jax.tree.map(lambda x: x[0], points) if here is None else here
            ahead = jax.tree.map(lambda x: x[1:], points)
            program = planner.program(plan, ahead, state.applied, end, self.safe, reserved)
            found = solve_program(
                program, jnp.zeros((planner.n_stages, n + 1)), warm=multipliers,
                max_iterations=self.max_iterations,
            )  # fmt: skip
            good = found.converged & jnp.all(jnp.isfinite(found.inputs)) & good
            moved = planner.moved(plan, found.states, found.inputs)
            over = planner.exceeded(program, found.excess, plan, moved, ahead)
            plan = _either(good, moved, plan)
            # what a failed solve leaves, or the one before it left, is no start for the next
            multipliers = jnp.where(good, found.multipliers, 0.0)
            iterations = iterations + found.iterations
        plan = _either(good, plan, kept)
        limit = planner.limits.command
        applied = plan.inputs[0].at[:n].set(jnp.clip(plan.inputs[0, :n], -limit, limit))
        # what the axes feel of friction is part of what is predicted, not of what is observed
        felt = applied[:n] - friction[0]
        error = here.position - now.position
        status = jnp.where(over, 1, 0)
        status = jnp.where(lost > 0, jnp.where(blind, 4, 2), status)
        status = jnp.where(good | blind, status, 3).astype(jnp.int32)
        return applied[:n], PredictiveState(
            observed=self.observer.predict(now, felt),
            progress=jnp.minimum(plan.progress[1], end),
            end=end,
            goal=state.goal,
            inputs=jnp.concatenate([plan.inputs[1:], self._tail(plan, good)[None]]),
            velocities=jnp.concatenate([plan.velocities[2:], plan.velocities[-1:]]),
            applied=applied,
            multipliers=program.shifted(multipliers),
            piece=piece,
            error=error - here.tangent * (here.tangent @ error),
            iterations=iterations,
            lost=lost,
            status=status,
            arrived=jnp.asarray(self._arrived(now, state), jnp.int32),
            heavy=None if heavy is None or self.heavy is None else self.heavy.predict(heavy, felt),
        )

    def _lost(self, state: PredictiveState, sample: Sample) -> tuple[Count, Scalar]:
        """Return how many measurements were lost in a row, and where to stop."""
        planner = self.planner
        whole = jnp.all(jnp.isfinite(sample.position))
        over = state.lost >= self.lost_samples
        lost = jnp.where(whole & ~over, 0, state.lost + 1).astype(jnp.int32)
        lost = jnp.minimum(lost, self.lost_samples)
        # as far as the axes need to stop along the path; half an axis' strength may be across it
        speed = state.applied[-1]
        braking = planner.limits.braking
        away = jnp.where(jnp.isfinite(braking), speed**2 / jnp.maximum(braking, 1e-300), 0.0)
        away = away + speed * planner.sample_time
        stop = jnp.minimum(state.end, state.progress + away)
        return lost, jnp.where((lost >= self.lost_samples) & ~over, stop, state.end)

    def program_at(self, state: PredictiveState, sample: Sample) -> StagedProgram:
        """Return the program that ``step`` solves first, scaled, for those who look into it.

        Parameters
        ----------
        state, sample
            As for ``step``.
        """
        _, plan, friction = self._before(state, sample)
        _, reserved = self._heavy(state, sample, friction)
        points = self.path.points(plan.progress[1:], state.piece)
        _, end = self._lost(state, sample)
        return self.planner.program(plan, points, state.applied, end, self.safe, reserved)

    def _before(self, state: PredictiveState, sample: Sample) -> tuple[Observed, Plan, Array]:
        """Return what is believed now, what is left of the last plan, and its friction."""
        measured = jnp.isfinite(sample.position)
        position = jnp.where(measured, sample.position, state.observed.position)
        now = self.observer.correct(state.observed, position)
        friction = self.friction * jnp.tanh(state.velocities / self.friction_velocity)
        plan = self.planner.roll_out(
            now.position, now.velocity, state.progress, state.inputs, now.disturbance - friction
        )
        return now, plan, friction

    def _heavy(
        self, state: PredictiveState, sample: Sample, friction: Array
    ) -> tuple[Observed | None, Array | None]:
        """Return what is believed of heavy axes, and what disturbs them along the plan."""
        if self.heavy is None or state.heavy is None:
            return None, None
        measured = jnp.isfinite(sample.position)
        position = jnp.where(measured, sample.position, state.heavy.position)
        heavy = self.heavy.correct(state.heavy, position)
        return heavy, heavy.disturbance - friction

    def _tail(self, plan: Plan, good: Flag) -> Array:
        """Return the input after the plan: the last again, or braking if there is no solution."""
        axes = self.planner.axes
        limit = self.planner.limits.command
        stop = -axes.velocity_from_velocity * plan.velocities[-1] / axes.velocity_from_command
        stop = jnp.clip(stop, -limit, limit)
        step = self.planner.limits.command_step
        if step is not None:
            before = plan.inputs[-1, :-1]
            stop = jnp.clip(stop, before - step, before + step)
        brake = jnp.append(stop, 0.0)
        return jnp.where(good, plan.inputs[-1], brake)

    def _arrived(self, now: Observed, state: PredictiveState) -> Flag:
        tolerance = self.arrival_tolerance
        goal = self.path.end_point(state.end)
        away = jnp.sqrt(jnp.sum((now.position - goal) ** 2))
        way = jnp.max(jnp.abs(now.velocity)) * self.planner.sample_time
        there = (state.progress >= state.end - tolerance) & (state.end >= state.goal)
        return there & (away <= tolerance) & (way <= tolerance)

    def telemetry(self, state: PredictiveState) -> dict[str, Array]:
        """Return the place on the path, its speed, the contour error, the disturbance found.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        last = state.progress - self.planner.sample_time * state.applied[-1]
        return {
            "contour_error_estimate": state.error,
            "path_parameter": jnp.asarray(self.path.parameter(last)),
            "path_speed": state.applied[-1],
            "disturbance": state.observed.disturbance,
            "iterations": jnp.asarray(state.iterations),
        }

    def status(self, state: PredictiveState) -> Count:
        """Return the status of the last step, an index into ``statuses``.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return state.status

    def finished(self, state: PredictiveState) -> Flag:
        """Return whether the axes stand at the end of the path.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return state.arrived == 1


def _either(first: Flag, one: Any, other: Any) -> Any:
    return jax.tree.map(lambda a, b: jnp.where(first, a, b), one, other)
