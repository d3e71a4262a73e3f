"""Machines: what really happens when a command is given."""

from contourlab.machines import published
from contourlab.machines.arctan_friction import ArctanFriction
from contourlab.machines.ball_screw import BallScrewAxes
from contourlab.machines.base import (
    COMMAND_KINDS,
    BoundDynamics,
    CommandKind,
    Dynamics,
    IdentityTool,
    LinearModel,
    LinearTool,
    NominalModel,
    ToolMap,
)
from contourlab.machines.cogging import Cogging
from contourlab.machines.control_systems import from_control, to_control
from contourlab.machines.disturbance import (
    Disturbance,
    SineDisturbance,
    StepDisturbance,
)
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import Encoder, Measurement, straight_through_round
from contourlab.machines.examples import (
    ball_screw_stage,
    iron_core_stage,
    linear_motor_stage,
    machining_centre,
)
from contourlab.machines.friction import Friction
from contourlab.machines.geometric_errors import GeometricErrors, PositionError, Squareness
from contourlab.machines.input_friction import InputFriction
from contourlab.machines.lagged import LaggedAxes
from contourlab.machines.machine import BoundMachine, Machine, MachineState
from contourlab.machines.presliding import PreslidingAxes
from contourlab.machines.rigid import RigidAxes
from contourlab.machines.state_space import StateSpaceAxes
from contourlab.machines.transfer_function import TransferFunctionAxes
from contourlab.machines.two_mass import TwoMassAxes

__all__ = [
    "COMMAND_KINDS",
    "ArctanFriction",
    "BallScrewAxes",
    "BoundDynamics",
    "BoundMachine",
    "Cogging",
    "CommandKind",
    "Disturbance",
    "Drive",
    "Dynamics",
    "Encoder",
    "Friction",
    "GeometricErrors",
    "IdentityTool",
    "InputFriction",
    "LaggedAxes",
    "LinearModel",
    "LinearTool",
    "Machine",
    "MachineState",
    "Measurement",
    "NominalModel",
    "PositionError",
    "PreslidingAxes",
    "RigidAxes",
    "SineDisturbance",
    "Squareness",
    "StateSpaceAxes",
    "StepDisturbance",
    "ToolMap",
    "TransferFunctionAxes",
    "TwoMassAxes",
    "ball_screw_stage",
    "from_control",
    "iron_core_stage",
    "linear_motor_stage",
    "machining_centre",
    "published",
    "straight_through_round",
    "to_control",
]
