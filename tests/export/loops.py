"""A closed loop for every control law: what the tests of the export replay."""

import functools

import numpy as np

import contourlab as cl
from contourlab import contour_errors as estimators
from contourlab import controllers
from contourlab.contours import Circle, Ellipse, FigureEight
from contourlab.feedrate import constant_feed, constant_rate
from contourlab.machines import Drive, Encoder, Friction, Machine, RigidAxes
from contourlab.machines.published import cao_zhang_stage
from contourlab.machines.published.cao_zhang import cao_zhang_pulse_model

ELLIPSE = Ellipse(semi_axes=(0.03, 0.01))
EIGHT = FigureEight(half_sizes=(5e-3, 5e-3), rotation=np.pi, start_angle=-0.5 * np.pi)
CIRCLE = Circle(radius=1e-3)
PLANT, MODEL = cao_zhang_pulse_model(4)


@functools.cache
def stage():
    """Dry friction and an encoder: signs and roundings for the laws to decide on."""
    return Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(
            mass=[4.0, 5.0], viscous=[20.0, 25.0], friction=Friction(coulomb=[3.0, 4.0])
        ),
        drive=Drive(command="force", command_limit=[60.0, 60.0]),
        sensor=Encoder(resolution=1e-7),
        substeps=4,
    )


@functools.cache
def feed_drive():
    """A feed drive with ball screws that takes a voltage."""
    rate, gain = 6.199371872, 0.02227943465  # 1/s and m/s² per V
    return Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(
            mass=1.0 / gain, viscous=rate / gain,
            friction=Friction(coulomb=0.1, smoothing_velocity=1e-6),
        ),
        drive=Drive(command="voltage", command_limit=20.0),
        sensor=Encoder(),
        substeps=20,
    )  # fmt: skip


def pid(model):
    return controllers.AxisPid.by_pole_placement(
        model, 20.0, derivative_cutoff_hz=200.0, velocity_feed_forward=1.0,
        acceleration_feed_forward=0.9, friction_feed_forward=0.5,
    )  # fmt: skip


def stage_pid():
    return controllers.AxisPid(
        model=cao_zhang_stage().nominal, kp=[34.96e3, 11.34e3], ki=[173.3e3, 54.11e3],
        kd=[400.0, 180.0],
    )  # fmt: skip


def coupled(estimator):
    return lambda model: controllers.CrossCoupled(
        axis=pid(model), estimator=estimator, kp=2e5, ki=1e6, kd=200.0
    )


HORIZONS = {"prediction_horizon": 16, "control_horizon": 4}
ON_THE_STAGE = {
    "AxisPid": pid,
    "Cascade": lambda model: controllers.Cascade.by_bandwidth(model, 40.0, 60.0),
    "CrossCoupled": coupled(estimators.OsculatingCircleEstimator()),
    "CrossCoupled, tangent": coupled(estimators.TangentEstimator()),
    "CrossCoupled, natural_local": coupled(estimators.NaturalLocalEstimator()),
    "CrossCoupled, extended_natural_local": coupled(estimators.ExtendedNaturalLocalEstimator()),
    "CrossCoupled, variable_gain": coupled(estimators.VariableGainEstimator()),
    "CrossCoupled, newton": coupled(estimators.NewtonEstimator()),
    "CrossCoupled, global_task_frame": coupled(estimators.GlobalTaskFrameEstimator()),
    "CrossCoupled, foot_point": coupled(estimators.FootPointEstimator()),
    "VariableGainCrossCoupled": lambda model: controllers.VariableGainCrossCoupled(
        axis=pid(model), kp=2e5, ki=1e6, kd=200.0
    ),
    "NewtonCrossCoupled": lambda model: controllers.NewtonCrossCoupled(
        axis=pid(model), guard=1e-4, kp=20.0, ki=100.0, kd=0.02, derivative_cutoff_hz=200.0
    ),
    "FirstOrderTaskFrame": lambda model: controllers.FirstOrderTaskFrame(
        model=model, bandwidth_hz=(15.0, 40.0)
    ),
    "NaturalLocalTaskFrame": lambda model: controllers.NaturalLocalTaskFrame(
        model=model, bandwidth_hz=(15.0, 40.0)
    ),
    "DirectAdaptiveRobust": lambda model: controllers.DirectAdaptiveRobust.by_bandwidth(
        model, (15.0, 25.0), uncertainty=0.3, disturbance_limit=100.0
    ),
    "IntegratedAdaptiveRobust": lambda model: controllers.IntegratedAdaptiveRobust.by_bandwidth(
        model, (15.0, 25.0), uncertainty=0.3, disturbance_limit=100.0
    ),
    "IntegralSlidingMode": lambda model: controllers.IntegralSlidingMode.by_bandwidth(
        model, 4.0, disturbance_bound=20.0
    ),
    "AxisPredictive": lambda model: controllers.AxisPredictive(
        model=model, input_weight=1e-11, **HORIZONS
    ),
    "PredictiveContouring": lambda model: controllers.PredictiveContouring(
        model=model, normal_input_weight=1e-11, tangential_input_weight=1e-10, **HORIZONS
    ),
}


@functools.cache
def ellipse(duration):
    return constant_rate(ELLIPSE, rate=6.0, duration=duration, sample_time=1e-3)


def loop(name, duration=0.5):
    """Return machine, controller and reference of a law's loop."""
    if name in ON_THE_STAGE:
        return stage(), ON_THE_STAGE[name](stage().nominal), ellipse(duration)
    if name == "ModelPredictiveContouring":
        law = controllers.ModelPredictiveContouring(
            model=feed_drive().nominal, speed_limit=0.03, horizon=20,
            velocity_limit=(0.018, 0.027), acceleration_limit=0.35,
        )  # fmt: skip
        return feed_drive(), law, constant_feed(EIGHT, feed=0.03, sample_time=5e-3)
    around = constant_rate(CIRCLE, rate=2.0, duration=duration, sample_time=1e-3)
    if name == "PositionDomainPid":
        law = controllers.PositionDomainPid(
            axis=stage_pid(), kp=11.34e3, ki=54.11e3 / 2e-3, kd=180.0 * 2e-3, master=0,
            least_speed=1e-5,
        )  # fmt: skip
    else:
        law = controllers.InternalModelContouring(
            axis=stage_pid(), master=0, numerator=PLANT[:2], denominator=MODEL[:2],
            identified_at=1e-3, stabiliser_gain=1e3 * np.array([-1500.0, -947.0]),
        )  # fmt: skip
    return cao_zhang_stage(), law, around


OTHERS = ("ModelPredictiveContouring", "PositionDomainPid", "InternalModelContouring")
NAMES = (*ON_THE_STAGE, *OTHERS)
__all__ = ["NAMES", "cl", "loop"]
