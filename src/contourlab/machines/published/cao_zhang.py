"""The galvoscanner-stage system of Cao and Zhang: an XY stage, and a scanner that moves with it.

    x(k+1) = G x(k) + H u(k),   y = [1 0] x,      at 1 kHz                              (43), (44)

The stage is X1 and X2 of (43), the scanner X3 and X4 of (44). Of the four axes the tool is at
(y1 - y3, y2 - y4): what the paper calls the relative position. (19) with (43) and (44) is all that
is printed of them; every model is of second order and stable, without an integrator.

What the paper leaves open, and what stands here instead:

- Units of position. Assumed: mm in the models and gains, as in the experiments; SI here.
- Units of the command. Assumed: volts.
- Limits of the drives. Assumed: none in the simulations.
- Digits: 1 + a1 + a2 is 1e-4 and 2e-4 on the stage, from four decimals, so that the gain at low
  frequency is known to a factor of two only. The printed digits are taken.
- Focal distance 100 of the scanner: taken to be in (44) already.
- The hardware's friction, and how the scanner's position is measured: see
  :func:`cao_zhang_emulated_stage`.

What laws are told (``nominal``) is M q'' + B q' + S q = u with the poles and the gain of each
printed model; its sampling zero comes from the poles. Laws that take a discrete model can be given
the printed one: :func:`cao_zhang_pulse_model`.

References
----------
.. [CaoZhang] section 6, (19), (43) and (44), Table 2.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import ConfigurationError
from contourlab.machines.base import Dynamics, LinearTool, NominalModel
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import Encoder
from contourlab.machines.friction import Friction
from contourlab.machines.input_friction import InputFriction
from contourlab.machines.machine import Machine
from contourlab.machines.state_space import StateSpaceAxes

__all__ = [
    "cao_zhang_emulated_stage",
    "cao_zhang_pulse_model",
    "cao_zhang_stage",
    "cao_zhang_stage_and_scanner",
]

SAMPLE_TIME = 1e-3
"""Of the identification [s]."""
DENOMINATORS = ((-1.9734, 0.9735), (-1.9581, 0.9583), (-1.7387, 0.7529), (-1.7261, 0.7405))
"""a1 and a2 of z² + a1 z + a2: minus the first columns of G in (43) and (44)."""
NUMERATORS = ((2.5259e-4, 2.5034e-4), (6.8214e-4, 6.7253e-4), (0.0270, 0.0246), (0.0253, 0.0228))
"""b1 and b2 of b1 z + b2 [mm per V]: H in (43) and (44)."""
TOOL = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]])
"""Relative position: stage less scanner."""
_OPEN = (
    "The paper prints no units of its models; assumed: mm and volts.",
    "It names no limits of the drives; assumed: none.",
)


def cao_zhang_pulse_model(n_axes: int = 2) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the printed models as numerators [m per V] and denominators, shape (n_axes, 2) each.

    Parameters
    ----------
    n_axes
        2 for the stage, 4 with the scanner.

    Raises
    ------
    ConfigurationError
        Another number of axes.
    """
    if n_axes not in (2, 4):
        raise ConfigurationError(f"n_axes must be 2 (stage) or 4 (with scanner), got {n_axes!r}")
    return 1e-3 * np.array(NUMERATORS[:n_axes]), np.array(DENOMINATORS[:n_axes])


def cao_zhang_stage() -> Machine:
    """Return the XY stage, X1 and X2, as it is simulated; the command is a voltage."""
    return Machine(
        names=("X1", "X2"), dynamics=_printed(2), drive=Drive(command="voltage"),
        sensor=Encoder(), nominal_model=_nominal(2), assumed=_OPEN,
        title="XY stage", source="Cao and Zhang, (43)",
    )  # fmt: skip


def cao_zhang_stage_and_scanner() -> Machine:
    """Return stage and scanner: four axes, X1 to X4, the tool at (y1 - y3, y2 - y4)."""
    return Machine(
        names=("X1", "X2", "X3", "X4"), dynamics=_printed(4), drive=Drive(command="voltage"),
        sensor=Encoder(), tool=LinearTool(matrix=TOOL),
        nominal_model=_nominal(4),
        assumed=(*_OPEN, "The focal distance of 100 is taken to be in (44) already."),
        title="XY stage and scanner", source="Cao and Zhang, (43) and (44)",
    )  # fmt: skip


def cao_zhang_emulated_stage(
    *,
    coulomb: float = 0.05,
    gain_error: tuple[float, float] = (0.02, -0.02),
    resolution: float | tuple[float, ...] = 10e-9,
    noise: float = 0.0,
    n_axes: int = 2,
) -> Machine:
    """Return an emulation of the hardware; of all this the paper prints the encoder only.

    Parameters
    ----------
    coulomb
        Dry friction of the stage's axes, in volts at the input, >= 0; the scanner has none.
    gain_error
        Of X1 and X2, relative to the model; the scanner has none.
    resolution
        Of the encoders [m], one for all or one per axis: 10 nm is printed (Table 2).
    noise
        Standard deviation of what the encoders show [m].
    n_axes
        2 for the stage, 4 with the scanner.

    Raises
    ------
    ConfigurationError
        A value out of bounds.
    """
    errors = np.zeros(n_axes)
    errors[:2] = gain_error
    axes = _printed(n_axes, 1.0 + errors).continuous()
    levels = np.where(np.arange(n_axes) < 2, coulomb, 0.0)
    dynamics: Dynamics = axes
    if coulomb > 0.0:
        dynamics = InputFriction(
            axes=axes, friction=Friction(coulomb=levels, smoothing_velocity=1e-4)
        )
    whole = cao_zhang_stage() if n_axes == 2 else cao_zhang_stage_and_scanner()
    return Machine(
        names=whole.names, dynamics=dynamics, drive=whole.drive, tool=whole.tool,
        sensor=Encoder(resolution=resolution, noise=noise if noise > 0.0 else None),
        nominal_model=whole.nominal_model, substeps=10, title=f"{whole.title}, emulated",
        assumed=(
            *whole.assumed,
            f"The machine is an emulation. Assumed: dry friction of {coulomb:g} V at the input of "
            "the stage, its sign smoothed over 0.1 mm/s, and gains that differ from the model by "
            f"{100 * gain_error[0]:g} and {100 * gain_error[1]:g} %; printed: encoders of 10 nm.",
        ),
    )  # fmt: skip


def _printed(n_axes: int, gain: NDArray[Any] | None = None) -> StateSpaceAxes:
    top, bottom = cao_zhang_pulse_model(n_axes)
    if gain is not None:
        top = top * gain[:, None]
    return StateSpaceAxes.per_axis(
        [
            StateSpaceAxes(
                state_matrix=np.array([[-a[0], 1.0], [-a[1], 0.0]]), input_matrix=b[:, None],
                output_matrix=np.array([[1.0, 0.0]]), sample_time=SAMPLE_TIME,
            )
            for a, b in zip(bottom, top, strict=True)
        ]
    )  # fmt: skip


def _nominal(n_axes: int) -> NominalModel:
    """M q'' + B q' + S q = u with the poles and the gain at low frequency of each axis."""
    top, bottom = cao_zhang_pulse_model(n_axes)
    poles = np.array([np.log(np.roots([1.0, *a])).real / SAMPLE_TIME for a in bottom])
    stiffness = (1.0 + bottom.sum(1)) / top.sum(1)
    mass = stiffness / poles.prod(1)
    return NominalModel(
        mass=mass, viscous=-mass * poles.sum(1), coulomb=np.zeros(n_axes), gain=np.ones(n_axes),
        command_limit=np.full(n_axes, np.inf), command="voltage", stiffness=stiffness,
    )  # fmt: skip
