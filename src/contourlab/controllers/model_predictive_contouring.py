"""Model predictive contouring control: the law plans its own speed along the path, under limits.

At each sample it plans N samples ahead: commands of the axes and a speed along the path, such that

    J = sum_(j=1..N) q_c |contour error|² + q_l lag² - γ v_s + |w_j - w_(j-1)|²_R             (1)

is least, w = (u, v_s), under limits on commands, their steps, axis velocities and accelerations and
on the contour error itself, with 0 <= v_s <= v_max, and such that the end of the path is not passed
and the axes can still stop there. Progress s along the path is a state, s' = v_s; the error is
p(s) - q, its share along the tangent is the lag. The first command is applied, and planning begins
anew at the next sample with what is left of the plan (one quadratic program a sample, "real-time
iteration"; ``passes`` for more).

It needs no feed plan: of the reference it takes where to start. It runs an open contour to its end
and a closed one once around; ``finished`` says when the axes stand there.

**Model and disturbance.** The nominal model held over a sample, with its Coulomb friction along the
planned velocity, and a disturbance that an observer finds from positions
(:mod:`~contourlab.controllers.model_predictive_contouring_axes`); what is constant leaves no error.

**Limits.** Those on commands, their steps and the path speed hold always. Those on axis velocity,
acceleration and contour error, and the one on stopping, are soft: a start beyond them, or a
disturbance, makes the law return as fast as ``limit_penalty`` says, and the status tells. The
contour error is limited as the plan sees it, to first order in its change, and the lag with it,
since at a corner what was across the path is along it; in space by an octagon across the path that
lies within the circle and is a thirteenth less at its flats.

**A mass that is more than the model's.** A plan of least time runs along the limit of the command;
so that axes that weigh more can follow it, it keeps a reserve after its first stage, which follows
from ``mass_uncertainty`` and is soft too
(:mod:`~contourlab.controllers.model_predictive_contouring_reserve`).

**When a solve fails** the law goes on with its last plan, and brakes where that ends. A measurement
that is not finite is replaced by what the model predicts. After ``lost_samples`` of them in a row
the law brakes to a stop on the path, on its model alone, and stays there. The status tells of all.

A corner is approached no faster than the axes can slow down for it, and at the end of the horizon
the speed must be one from which they can slow down for every turn ahead, and stop
(:mod:`~contourlab.controllers.model_predictive_contouring_speed`).

**Where it is good, and where not.** The horizon N T should cover the time in which the axes stop
from v_max: a shorter one is safe, and slower. Corners and jumps of curvature are taken: the plan
slows where the errors' cost demands it. A longer horizon is not always faster: the path is
linearised about the last plan. q_l must not be small beside q_c (a tenth is enough) or s runs away
from the tool, and the contour error is then not the distance.

Progress as a state of the program is due to Lam, Manzie and Good (2010), whose paper was not read:
(1) is written as the literature after it does, without a nonlinear solver. Soft limits, the
stopping condition and the observer are ours.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import is_concrete, part, real, replace, static
from contourlab.contours.base import Contour
from contourlab.controllers.axis_controller import (
    SHARED_AXES,
    per_axis,
    refuse_no_model,
    refuse_position_command,
    refuse_unlike_axes,
)
from contourlab.controllers.base import Controller, Needs
from contourlab.controllers.held_model import held_axes
from contourlab.controllers.model_predictive_contouring_axes import observer
from contourlab.controllers.model_predictive_contouring_law import BoundModelPredictiveContouring
from contourlab.controllers.model_predictive_contouring_path import progress_path
from contourlab.controllers.model_predictive_contouring_program import (
    ContouringProgram,
    Limits,
    command_ranges,
)
from contourlab.controllers.model_predictive_contouring_reserve import HELD_AND_MADE_UP
from contourlab.controllers.model_predictive_contouring_speed import safe_speed, turn_in_length
from contourlab.controllers.model_predictive_contouring_weights import natural_weights
from contourlab.errors import RefusedError
from contourlab.machines.base import NominalModel
from contourlab.typing import Array, Scalar

__all__ = ["ModelPredictiveContouring"]


class ModelPredictiveContouring(Controller):
    """Constrained predictive contouring with its own progress; see the module.

    Parameters
    ----------
    model
        Nominal model of 2 or 3 axes, commanded by a voltage, a force or a velocity.
    speed_limit
        v_max, greatest speed along the path, > 0 [m/s].
    horizon
        N >= 2, samples.
    contour_weight, lag_weight
        q_c and q_l, > 0 [1/m²]; if not given by the size of the machine
        (:mod:`~contourlab.controllers.model_predictive_contouring_weights`), as are the next three.
    progress_reward
        γ, > 0 [s/m]: what a sample at 1 m/s is worth; 1 / v_max if not given.
    command_change_weight
        R of the commands, > 0, one number or one per axis [1/command²].
    speed_change_weight
        R of the path speed, > 0 [s²/m²].
    velocity_limit, acceleration_limit
        Of each axis, > 0, one number or one per axis [m/s, m/s²]; none if not given.
    command_step_limit
        Greatest change of a command over a sample, > 0, one number or one per axis; none if not
        given.
    contour_error_limit
        Greatest planned error across the path, and along it, > 0 [m]; none if not given.
    limit_penalty
        > 0, cost of exceeding a soft limit by its own size, in units of the reward of one sample at
        full speed.
    braking_share
        Share, above 0 to 1, of the deceleration by the command limit (and of the acceleration
        limit) that slowing down and stopping after the horizon may count on.
    mass_uncertainty
        δ, share of the model's mass that the axes may weigh more, >= 0, one number or one per axis:
        a plan keeps the reserve of its commands that such a mass takes
        (:mod:`~contourlab.controllers.model_predictive_contouring_reserve`); 0 keeps none.
    observe_disturbance
        Whether what the model does not know is found and planned for; without, the observer finds
        velocities alone.
    observer_bandwidth_hz
        Of the observer, > 0, one number or one per axis [Hz]; a tenth of the sampling rate if not
        given.
    friction_compensation
        Share, 0 to 1, of the model's Coulomb friction that is planned for.
    friction_velocity
        Width of the smooth sign, > 0 [m/s]; a fiftieth of v_max if not given.
    arrival_tolerance
        Distance from the end, and greatest way over a sample, at which the law has arrived, > 0
        [m]; 0.03 v_max T if not given.
    lost_samples
        Measurements lost in a row, >= 1, after which the law stops on the path and stays there.
    passes
        Programs a sample, >= 1, each about the solution of the one before.
    max_iterations
        Of the solver, >= 1.

    Raises
    ------
    ConfigurationError
        A value out of bounds, or a wrong number of them.
    RefusedError
        The model is commanded by positions, or has another number of axes than 2 or 3.
    """

    model: NominalModel = part()
    speed_limit: Scalar = real(unit="m/s", above=0.0, ndim=0)
    horizon: int = static(minimum=2, default=20)
    contour_weight: Scalar | None = real(above=0.0, ndim=0, default=None)
    lag_weight: Scalar | None = real(above=0.0, ndim=0, default=None)
    progress_reward: Scalar | None = real(above=0.0, ndim=0, default=None)
    command_change_weight: Float[Array, " ..."] | None = real(above=0.0, default=None)
    speed_change_weight: Scalar | None = real(above=0.0, ndim=0, default=None)
    velocity_limit: Float[Array, " ..."] | None = real(unit="m/s", above=0.0, default=None)
    acceleration_limit: Float[Array, " ..."] | None = real(unit="m/s^2", above=0.0, default=None)
    command_step_limit: Float[Array, " ..."] | None = real(above=0.0, default=None)
    contour_error_limit: Scalar | None = real(unit="m", above=0.0, ndim=0, default=None)
    limit_penalty: Scalar = real(above=0.0, ndim=0, default=100.0)
    braking_share: Scalar = real(above=0.0, maximum=1.0, ndim=0, default=0.8)
    mass_uncertainty: Float[Array, " ..."] = real(minimum=0.0, default=0.1)
    observe_disturbance: bool = static(flag=True, default=True)
    observer_bandwidth_hz: Float[Array, " ..."] | None = real(unit="Hz", above=0.0, default=None)
    friction_compensation: Float[Array, " ..."] = real(minimum=0.0, maximum=1.0, default=1.0)
    friction_velocity: Float[Array, " ..."] | None = real(unit="m/s", above=0.0, default=None)
    arrival_tolerance: Scalar | None = real(unit="m", above=0.0, ndim=0, default=None)
    lost_samples: int = static(minimum=1, default=10)
    passes: int = static(minimum=1, default=1)
    max_iterations: int = static(minimum=1, default=30)

    def __check_init__(self) -> None:
        refuse_no_model(self.model)

    def check(self) -> None:
        """Check the number of axes, and that the model takes no positions."""
        refuse_position_command(type(self).__name__, self.model)
        if self.model.n_axes not in (2, 3):
            raise RefusedError(
                f"{type(self).__name__} is for machines of 2 or 3 axes, the model has "
                f"{self.model.n_axes}: it weighs the lag and the error across the path in the "
                "plane or in space. PredictiveContouring takes one axis for each coordinate of the "
                f"contour, of any number; where axes share a coordinate, {SHARED_AXES}"
            )

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return self.model.n_axes

    @property
    def needs(self) -> Needs:
        """The model's kind of command, and the contour; time of its own."""
        return Needs(command=self.model.command, contour=True, own_time=True)

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundModelPredictiveContouring:
        """Return the law for one contour and sample time.

        Parameters
        ----------
        contour
            The path that the loop follows.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            The contour has not one coordinate per axis.
        ConfigurationError
            A setting of the wrong number.
        """
        n, model = self.n_axes, self.model
        refuse_unlike_axes(type(self).__name__, n, contour)

        def each(name: str) -> Array:
            return jnp.asarray(per_axis(name, getattr(self, name), n))

        def optional(name: str) -> Array | None:
            return None if getattr(self, name) is None else each(name)

        axes = held_axes(model, sample_time)
        speed, time = jnp.asarray(self.speed_limit), jnp.asarray(sample_time)
        acceleration = optional("acceleration_limit")
        command = jnp.asarray(model.command_limit)
        more = HELD_AND_MADE_UP * each("mass_uncertainty")
        nominal = command * model.gain / model.mass
        braking = nominal / (1.0 + more)
        if acceleration is not None:
            nominal = jnp.minimum(nominal, acceleration)
            braking = jnp.minimum(braking, acceleration)
        limits = Limits(
            command=command,
            speed=speed,
            command_step=optional("command_step_limit"),
            velocity=optional("velocity_limit"),
            acceleration=acceleration,
            contour_error=self.contour_error_limit,
            braking=self.braking_share * jnp.min(braking),
            penalty=self.limit_penalty,
        )
        ranges = command_ranges(axes, limits)
        ample = jnp.min(ranges * axes.velocity_from_command) / time
        natural = jnp.where(jnp.isfinite(jnp.min(nominal)), jnp.min(nominal), ample)
        weights = natural_weights(
            speed, natural, ranges, time, contour=self.contour_weight, lag=self.lag_weight,
            reward=self.progress_reward, command_change=optional("command_change_weight"),
            speed_change=self.speed_change_weight,
        )  # fmt: skip
        path = progress_path(contour)
        turn_in = turn_in_length(speed, time, self.contour_error_limit)
        bandwidth, width = optional("observer_bandwidth_hz"), optional("friction_velocity")
        bandwidth = 0.1 / time if bandwidth is None else bandwidth
        tolerance = self.arrival_tolerance
        # what is known to be no reserve costs no rows
        known = is_concrete(self.mass_uncertainty)
        kept = not known or bool(np.any(np.asarray(self.mass_uncertainty) > 0.0))
        heavy = held_axes(replace(model, mass=model.mass * (1.0 + more)), time) if kept else None
        return BoundModelPredictiveContouring(
            path=path,
            safe=safe_speed(path, limits.braking, turn_in),
            observer=observer(axes, bandwidth, time, disturbance=self.observe_disturbance),
            heavy=None if heavy is None else observer(
                heavy, bandwidth, time, disturbance=self.observe_disturbance
            ),
            planner=ContouringProgram(axes, weights, limits, time, self.horizon, heavy),
            friction=each("friction_compensation") * model.coulomb / model.gain,
            friction_velocity=jnp.full(n, 0.02 * speed) if width is None else width,
            arrival_tolerance=0.03 * speed * time if tolerance is None else tolerance,
            passes=self.passes,
            max_iterations=self.max_iterations,
            lost_samples=self.lost_samples,
        )  # fmt: skip
