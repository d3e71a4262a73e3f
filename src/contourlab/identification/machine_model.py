"""The machine that an identification speaks of, for simulations and machine files.

Gain 1: masses and frictions are in units of the command, and the laws are told the same. Where a
record does not tell something, the machine says in ``assumed`` what stands there instead.

A spring goes into a transfer function, which has no place for dry friction: then friction is in
what laws are told, and not in the machine. Travel and limits are what the record reached.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import RecordingError
from contourlab.feedrate.limits import AxisLimits
from contourlab.identification.frequency_model import FrequencyModel
from contourlab.identification.machine_result import AxisModel, MachineIdentification
from contourlab.identification.position_loop_response import loop_polynomials
from contourlab.machines.base import NominalModel
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import Encoder
from contourlab.machines.friction import Friction
from contourlab.machines.lagged import LaggedAxes
from contourlab.machines.machine import Machine
from contourlab.machines.rigid import RigidAxes
from contourlab.machines.transfer_function import TransferFunctionAxes
from contourlab.machines.two_mass import TwoMassAxes

__all__ = ["identified_machine"]

ROOM = 0.1
"""Travel beyond the record, as a share of its stroke."""
LEAST_JERK_TIME = 0.01
"""Where no jerk is known: the largest acceleration is reached in this time [s]."""
LEAST_MASS = 0.05
"""Share of τ / K_v that laws are told as mass of a position loop, at least: feed-forward makes a
loop quicker than any mass."""
COUNT_SHARE = 0.98
"""Share of neighbouring measured positions that lie on one grid for it to be counts."""


def identified_machine(
    found: MachineIdentification, *, models: Sequence[FrequencyModel] = (), title: str = ""
) -> Machine:
    """Return the machine that was identified.

    Parameters
    ----------
    found
        Of ``identify_machine``.
    models
        Fitted to frequency responses: where every axis has two masses, and all six parameters of
        them are told, so has the machine; else ``assumed`` says what is not.
    title
        What the machine is, for people.

    Raises
    ------
    RecordingError
        An axis has no mass or viscous friction, or a mass that may be 0: there is no machine.
    """
    axes, assumed = found.axes, []
    split = {m.axis for m in models if m.model == "two_mass" and _whole(m)}
    if axes and split >= {axis.axis for axis in axes}:
        return _two_masses(found, {m.axis: m for m in models}, title)
    assumed += _left_out(models)
    if axes and all("velocity_gain" in axis.parameters for axis in axes):
        return _position_loops(found, title, assumed)
    for axis in axes:
        _refuse(axis)
    mass, viscous, stiffness = (_row(axes, name) for name in ("mass", "viscous", "stiffness"))
    viscous = np.maximum(viscous, 0.0)
    ahead, back, said = _friction(axes)
    assumed += said
    lag = _row(axes, "drive_lag") if "drive_lag" in axes[0].parameters else np.zeros(len(axes))
    delay, said = _delay(axes)
    assumed += said
    limits, travel = _limits(found)
    assumed.append(
        "Travel and axis limits are what the record reached, with a tenth of its stroke more; they "
        "are no data of the machine."
    )
    assumed.append(
        "Masses, friction and stiffness are in units of the command: the record does not tell mass "
        "from input gain."
    )
    dry = bool(np.any(ahead > 0.0) or np.any(back > 0.0))
    friction = Friction(coulomb=ahead, coulomb_backward=back) if dry else None
    dynamics: Any
    if np.any(stiffness != 0.0) or found.command_kind == "position":
        if np.any(stiffness < 0.0):
            raise RecordingError("a stiffness is negative: such an axis is not stable by itself")
        dynamics = TransferFunctionAxes(
            numerators=tuple((1.0,) for _ in axes),
            denominators=tuple(zip(mass.tolist(), viscous.tolist(), stiffness.tolist(),
                                   strict=True)),
        )  # fmt: skip
        if dry:
            assumed.append(
                "Dry friction of "
                + ", ".join(f"{a.axis}: {a.coulomb:.4g} {a['coulomb_forward'].unit}" for a in axes)
                + " is left out: a machine file has no place for friction on axes with a spring. "
                "Laws are told of it."
            )
    else:
        dynamics = RigidAxes(mass=mass, viscous=viscous, gain=1.0, friction=friction)
    if np.any(lag > 0.0):
        dynamics = LaggedAxes(axes=dynamics, time_constant=np.where(lag > 0.0, lag, 1e-6))
    limit = np.asarray(found.command_limit, float)
    resolution, noise = _sensor(axes)
    return Machine(
        names=tuple(axis.axis for axis in axes), dynamics=dynamics,
        drive=Drive(command=found.command_kind, command_limit=limit, computing_delay=delay),
        sensor=Encoder(resolution=resolution, noise=noise if np.any(noise > 0.0) else None),
        travel=travel, limits=limits, assumed=tuple(assumed),
        nominal_model=NominalModel(
            mass=mass, viscous=viscous, coulomb=np.maximum(0.5 * (ahead + back), 0.0),
            gain=np.ones(len(axes)), command_limit=limit, command=found.command_kind,
            stiffness=stiffness if np.any(stiffness != 0.0) else None,
        ),
        title=title or "Identified machine",
        source=found.source or "identified from a recording",
    )  # fmt: skip


def _whole(model: FrequencyModel) -> bool:
    """Return whether a response tells how two masses share: on the load it hardly does."""
    return all(one.identified for one in model.parameters.values())


def _left_out(models: Sequence[FrequencyModel]) -> list[str]:
    """Return why two masses that a response shows are not in the machine."""
    two = {model.axis: model for model in models if model.model == "two_mass"}
    said = []
    for axis, model in two.items():
        lacks = [name for name, one in model.parameters.items() if not one.identified]
        said.append(
            f"A frequency response of {axis} shows two masses"
            + (f", but does not tell {', '.join(lacks)}" if lacks else "")
            + "; the machine has them only where every axis tells all of them."
        )
    return said


def _two_masses(
    found: MachineIdentification, models: dict[str, FrequencyModel], title: str
) -> Machine:
    """Return a machine of two masses, from frequency responses; friction from the motion."""
    chosen = [models[axis.axis] for axis in found.axes]
    rows: dict[str, Any] = {
        name: np.array([model[name].value for model in chosen])
        for name in ("motor_mass", "load_mass", "stiffness", "damping", "motor_viscous")
    }
    ahead, back, assumed = _friction(found.axes)
    dry = bool(np.any(ahead > 0.0) or np.any(back > 0.0))
    delays = np.array([model["delay"].value for model in chosen])
    if np.ptp(delays) > 0.1 * found.sample_time:
        each = ", ".join(f"{m.axis} {1e3 * m['delay'].value:.3g} ms" for m in chosen)
        assumed.append(f"Delays differ ({each}); the machine has their mean.")
    limits, travel = _limits(found)
    assumed += [
        "Travel and axis limits are what the record reached, with a tenth of its stroke more; they "
        "are no data of the machine.",
        "Masses, friction and stiffness are in units of the command: the record does not tell mass "
        "from input gain.",
        "All dry friction stands on the motor side: a frequency response does not tell which.",
    ]
    resolution, noise = _sensor(found.axes)
    return Machine(
        names=tuple(axis.axis for axis in found.axes),
        dynamics=TwoMassAxes(
            **rows,
            motor_friction=Friction(coulomb=ahead, coulomb_backward=back) if dry else None,
        ),
        drive=Drive(
            command=found.command_kind, command_limit=np.asarray(found.command_limit, float),
            computing_delay=max(float(delays.mean()), 0.0),
        ),
        sensor=Encoder(
            resolution=resolution, noise=noise if np.any(noise > 0.0) else None,
            side=tuple("motor" if model.side == "motor" else "tool" for model in chosen),
        ),
        travel=travel, limits=limits, assumed=tuple(assumed), title=title or "Identified machine",
        source=found.source or "identified from a recording",
    )  # fmt: skip


def _position_loops(found: MachineIdentification, title: str, assumed: list[str]) -> Machine:
    """Return a machine whose axes are position loops; laws are told of a mass on a spring that
    follows alike at low frequency."""
    tops, bottoms, nominal = [], [], []
    assumed = list(assumed)
    for axis in found.axes:
        gain, share, lag = (
            axis[name].value for name in ("velocity_gain", "feed_forward", "time_constant")
        )
        if not np.isfinite([gain, lag]).all():
            raise RecordingError(
                f"axis {axis.axis}: the record does not tell velocity gain and time constant of "
                "the loop one by one, so that there is no machine to write; record sharper motion, "
                "or give what is known of it"
            )
        if not np.isfinite(share):
            assumed.append(f"Feed-forward of {axis.axis} was not told; assumed: none.")
            share = 0.0
        rate = axis["integral_rate"].value
        top, feed, bottom = loop_polynomials(gain, lag, rate if np.isfinite(rate) else 0.0)
        tops.append(tuple(np.polyadd(top, share * feed).tolist()))
        bottoms.append(tuple(bottom.tolist()))
        quick = lag / gain
        # of 1/H, from (2) of the response; with an integral τ is in the third power of s alone
        mass = (0.0 if np.isfinite(rate) else quick) - share * (1.0 - share) / gain**2
        nominal.append((max(mass, LEAST_MASS * quick), max((1.0 - share) / gain, 0.0), 1.0))
    delay, said = _delay(found.axes)
    # a held command is half a sample late by itself
    half = 0.5 * found.sample_time
    computing = max(delay - half, 0.0)
    said.append(
        f"Delay {1e3 * computing:.4g} ms is less half a log sample, {1e3 * half:.4g} ms, which a "
        f"held command adds: it holds in a loop of {1e3 * found.sample_time:.4g} ms."
    )
    if delay < half:
        said.append(
            f"The delay found, {1e3 * delay:.4g} ms, is less than that: the machine is "
            f"{1e3 * (half - delay):.4g} ms later than the log."
        )
    limits, travel = _limits(found)
    assumed += [
        *said,
        "Travel and axis limits are what the record reached, with a tenth of its stroke more; they "
        "are no data of the machine.",
        "Dry friction is left out: a machine file has no place for friction inside a position "
        "loop.",
    ]
    mass, viscous, stiffness = np.array(nominal).T
    resolution, noise = _sensor(found.axes)
    limit = np.asarray(found.command_limit, float)
    return Machine(
        names=tuple(axis.axis for axis in found.axes),
        dynamics=TransferFunctionAxes(numerators=tuple(tops), denominators=tuple(bottoms)),
        drive=Drive(command="position", command_limit=limit, computing_delay=computing),
        sensor=Encoder(resolution=resolution, noise=noise if np.any(noise > 0.0) else None),
        travel=travel, limits=limits, assumed=tuple(assumed),
        nominal_model=NominalModel(
            mass=mass, viscous=viscous, coulomb=np.zeros(len(mass)), gain=np.ones(len(mass)),
            command_limit=limit, command="position", stiffness=stiffness,
        ),
        title=title or "Identified position loops",
        source=found.source or "identified from a recording",
    )  # fmt: skip


def _refuse(axis: AxisModel) -> None:
    for name in ("mass", "viscous"):
        if not axis[name].identified:
            raise RecordingError(
                f"axis {axis.axis}: {name} could not be found from this record, so that there is "
                "no machine to write; record an exciting motion, or give what is known of it"
            )
    if not axis["mass"].low > 0.0:
        raise RecordingError(f"axis {axis.axis}: the interval of the mass reaches 0")


def _row(axes: tuple[AxisModel, ...], name: str) -> NDArray[Any]:
    return np.array([axis[name].value if axis[name].identified else 0.0 for axis in axes])


def _friction(axes: tuple[AxisModel, ...]) -> tuple[NDArray[Any], NDArray[Any], list[str]]:
    ahead, back, said = [], [], []
    for axis in axes:
        ways = [axis[f"coulomb_{way}"] for way in ("forward", "backward")]
        known = [way.value for way in ways if way.identified]
        if not known:
            said.append(f"Dry friction of {axis.axis} was not found; assumed: none.")
            known = [0.0]
        elif len(known) == 1:
            said.append(f"Dry friction of {axis.axis} is known one way only; taken for both.")
        pair = known * 2 if len(known) == 1 else known
        # no surer than its interval: what may be nothing is nothing
        pair = [0.0 if w.identified and w.low <= 0.0 <= w.high else p
                for w, p in zip(ways, pair, strict=True)]  # fmt: skip
        if min(pair) < 0.0:
            said.append(
                f"{axis.axis}: a constant force of {axis.constant_force:.4g} {ways[0].unit} is "
                "larger than friction; the machine has the mean friction and not the force."
            )
            pair = [max(0.5 * (pair[0] + pair[1]), 0.0)] * 2
        elif all(w.identified for w in ways) and (
            ways[0].low > ways[1].high or ways[1].low > ways[0].high
        ):
            said.append(
                f"{axis.axis}: what differs between the directions stands as friction; a constant "
                "force would look the same."
            )
        ahead.append(pair[0])
        back.append(pair[1])
    return np.array(ahead), np.array(back), said


def _delay(axes: tuple[AxisModel, ...]) -> tuple[float, list[str]]:
    known = [axis["delay"] for axis in axes if axis["delay"].identified]
    if not known:
        return 0.0, ["The motion does not tell a delay; assumed: none."]
    values = np.array([one.value for one in known])
    half = np.array([0.5 * (one.high - one.low) for one in known])
    if np.all(half > 0.0):
        delay = float(np.average(values, weights=half**-2.0))
    else:
        delay = float(values.mean())
    said = []
    apart = np.abs(values - delay) > np.maximum(half, 1e-9)
    if len(known) > 1 and apart.any() and np.ptp(values) > 1e-5:
        each = ", ".join(
            f"{axis.axis} {1e3 * axis['delay'].value:.3g} ms"
            for axis in axes
            if axis["delay"].identified
        )
        said.append(f"Delays differ ({each}); the machine has one, {1e3 * delay:.4g} ms.")
    if delay < 0.0 or any(one.low <= 0.0 <= one.high for one in known):
        delay = max(delay, 0.0) if delay > float(half.max()) else 0.0
    return delay, said


def _sensor(axes: tuple[AxisModel, ...]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return counts where positions lie on a grid, and noise where they do not."""
    counts, noise = np.zeros(len(axes)), np.zeros(len(axes))
    for k, axis in enumerate(axes):
        steps = np.abs(np.diff(axis.measured[: 1 << 16]))
        steps = steps[steps > 1e-12]
        if len(steps):
            least = float(np.min(steps))
            whole = np.abs(steps / least - np.round(steps / least)) < 1e-3
            if float(whole.mean()) > COUNT_SHARE:
                counts[k] = float(f"{least:.6g}")
        rest = axis.encoder_noise**2 - counts[k] ** 2 / 12.0
        if rest > (0.3 * counts[k]) ** 2 or (counts[k] == 0.0 and rest > 0.0):
            noise[k] = float(f"{np.sqrt(rest):.3g}")
    return counts, noise


def _limits(found: MachineIdentification) -> tuple[AxisLimits, NDArray[Any]]:
    velocity = np.array([axis.speed for axis in found.axes])
    acceleration = np.array([axis.acceleration for axis in found.axes])
    least = acceleration / LEAST_JERK_TIME
    jerk = np.where(np.isfinite(found.jerk), found.jerk, least)
    jerk = np.clip(jerk, 0.1 * least, least)
    stroke = np.ptp(found.travel, axis=1)[:, None]
    room = ROOM * np.maximum(stroke, 1e-3) * np.array([-1.0, 1.0])
    return (
        AxisLimits(velocity=velocity, acceleration=acceleration, jerk=jerk),
        found.travel + room,
    )
