"""Machines: what really happens when a command is given."""

from contourlab.machines import published
from contourlab.machines.base import (
    COMMAND_KINDS,
    BoundDynamics,
    CommandKind,
    Dynamics,
    IdentityTool,
    LinearTool,
    NominalModel,
    ToolMap,
)
from contourlab.machines.disturbance import (
    Disturbance,
    SineDisturbance,
    StepDisturbance,
)
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import Encoder, Measurement, straight_through_round
from contourlab.machines.examples import ball_screw_stage, linear_motor_stage
from contourlab.machines.friction import Friction
from contourlab.machines.machine import BoundMachine, Machine, MachineState
from contourlab.machines.rigid import RigidAxes
from contourlab.machines.transfer_function import TransferFunctionAxes

__all__ = [
    "COMMAND_KINDS",
    "BoundDynamics",
    "BoundMachine",
    "CommandKind",
    "Disturbance",
    "Drive",
    "Dynamics",
    "Encoder",
    "Friction",
    "IdentityTool",
    "LinearTool",
    "Machine",
    "MachineState",
    "Measurement",
    "NominalModel",
    "RigidAxes",
    "SineDisturbance",
    "StepDisturbance",
    "ToolMap",
    "TransferFunctionAxes",
    "ball_screw_stage",
    "linear_motor_stage",
    "published",
    "straight_through_round",
]
