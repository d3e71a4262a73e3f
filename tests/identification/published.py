"""Every published machine with the noise of an encoder, a motion that tells, and the truth."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import fsolve
from scipy.signal import cont2discrete

import contourlab as cl
from contourlab.controllers import FilteredLeastSquares
from contourlab.machines.published.cao_zhang import cao_zhang_pulse_model
from contourlab.recordings import Reference

from .machines import varied_reference, with_sensor

PUBLISHED = cl.machines.published
GANTRY_SIGN = FilteredLeastSquares(
    cutoff_hz=150.0, friction_shape="arctan", friction_velocity=1.0 / 9000.0
)


class Case(NamedTuple):
    machine: Any
    """With counts and noise of the encoder."""
    size: tuple[float, ...]
    """Of the motion of each axis [m]."""
    sample_time: float
    bandwidth: float | tuple[float, ...]
    """Of the loop [Hz]."""
    motion: Mapping[str, Any] = MappingProxyType({})
    """Beside ``size`` and ``sample_time``; it lasts 5 s if nothing else is said."""
    options: Mapping[str, Any] = MappingProxyType({})
    """Of ``identify_machine``."""
    dry: tuple[Any, Any] = (0.0, 0.0)
    """Forwards and backwards."""
    share: Mapping[str, Any] = MappingProxyType({})
    """Truth over what laws are told, where that differs."""

    def truth(self) -> dict[str, Any]:
        """By name, shape (n_axes,) each, in units of the command."""
        nominal, n = self.machine.nominal, len(self.size)
        found = {"mass": nominal.mass / nominal.gain, "viscous": nominal.viscous / nominal.gain}
        if nominal.stiffness is not None:
            found["stiffness"] = nominal.stiffness / nominal.gain
        for name, share in self.share.items():
            found[name] = found[name] * np.asarray(share)
        for way, level in zip(("forward", "backward"), self.dry, strict=True):
            found[f"coulomb_{way}"] = np.broadcast_to(level, n)
        if "known" not in self.options:
            found["delay"] = np.zeros(n)
        return {name: np.asarray(row, float) for name, row in found.items()}

    def law(self) -> Any:
        return cl.controllers.AxisPid.by_pole_placement(
            self.machine.nominal, bandwidth_hz=self.bandwidth
        )

    def reference(self) -> Reference:
        return varied_axes(self.size, self.sample_time, **{"duration": 5.0, **self.motion})


def varied_axes(size: tuple[float, ...], sample_time: float, **motion: Any) -> Reference:
    """A varied reference for two to four axes, of which the last two carry the tool."""
    if len(size) == 2:
        return varied_reference(size, sample_time, **motion)
    flat, n = varied_reference(size[:2], sample_time, **motion), len(size)
    frequency, phase = np.array((2.0, 3.0, 2.0, 3.0)[:n]), np.array((0.3, 0.0, 1.2, 0.8)[:n])
    s, rate, change = (
        np.asarray(row)[:, None]
        for row in (flat.parameter, flat.parameter_rate, flat.parameter_acceleration)
    )
    angle, wide = s * frequency + phase, np.array(size)
    acceleration = wide * frequency * (
        np.cos(angle) * change - frequency * np.sin(angle) * rate**2
    )  # fmt: skip
    tool = wide * np.exp(1j * phase)
    if n == 4:  # stage less scanner
        tool = tool[:2] - tool[2:]
    contour = cl.contours.Lissajous(
        amplitudes=np.abs(tool), frequencies=frequency[: len(tool)], phases=np.angle(tool)
    )
    return Reference(
        sample_time=sample_time, parameter=s[:, 0], parameter_rate=rate[:, 0],
        parameter_acceleration=change[:, 0], position=wide * np.sin(angle),
        velocity=wide * frequency * np.cos(angle) * rate, acceleration=acceleration,
        jerk=np.gradient(acceleration, sample_time, axis=0), contour=contour,
    )  # fmt: skip


def _as_printed(hertz: tuple[float, ...]) -> dict[str, Any]:
    """Masses and viscous friction that the printed models of Cao and Zhang have at a frequency.

    Their zeros are not those of a command that is held. Of the poles alone, which laws are told,
    the scanner's masses are off by 3e-4 and its viscous friction by 5e-5, more than the intervals.
    """
    step, nominal = 1e-3, PUBLISHED.cao_zhang_stage_and_scanner().nominal
    found = []
    for k, (top, bottom) in enumerate(zip(*cao_zhang_pulse_model(4), strict=True)):
        z = np.exp(2j * np.pi * hertz[k] * step)
        wanted = np.polyval(top, z) / np.polyval([1.0, *bottom], z)

        def miss(share: Any, k: int = k, z: Any = z, wanted: Any = wanted) -> list[float]:
            model = [
                share[0] * nominal.mass[k],
                share[1] * nominal.viscous[k],
                nominal.stiffness[k],
            ]
            upper, lower, _ = cont2discrete(([1.0], model), step)
            off = 1e6 * (np.polyval(upper[0], z) / np.polyval(lower, z) / wanted - 1.0)
            return [off.real, off.imag]

        found.append(fsolve(miss, np.ones(2)))
    return dict(zip(("mass", "viscous"), np.transpose(found), strict=True))


def _seen(machine: Any, resolution: float, noise: float, *rest: Any, **more: Any) -> Case:
    return Case(with_sensor(machine, resolution, noise), *rest, **more)


CASES: dict[str, Callable[[], Case]] = {
    "meng_xy_stage": lambda: _seen(
        PUBLISHED.meng_xy_stage(), 1e-6, 0.5e-6, (0.012, 0.009), 1e-3, 60.0,
        motion={"duration": 4.0}, dry=((0.12, 0.07), (0.11, 0.06)),
    ),
    "meng_emulated_stage": lambda: _seen(
        PUBLISHED.meng_emulated_stage(), 1e-6, 0.5e-6, (0.012, 0.009), 1e-3, 60.0,
        motion={"duration": 4.0}, options={"known": {"drive_lag": 1.46e-3}},
        dry=((0.96 * 0.12, 0.96 * 0.07), (0.96 * 0.11, 0.96 * 0.06)),
        share={"viscous": (0.966, 0.951)},
    ),
    "meng_simulated_axes": lambda: _seen(
        PUBLISHED.meng_simulated_axes(), 1e-6, 0.5e-6, (0.02, 0.015, 0.012), 1e-3, 60.0,
        motion={"duration": 4.0}, share={"viscous": (200.0 / 205.0, 225.0 / 230.0, 1.0)},
    ),
    "el_khalick_feed_drive": lambda: _seen(
        PUBLISHED.el_khalick_feed_drive(n_axes=3), 1e-6, 1e-6, (0.006, 0.004, 0.005), 5e-3, 4.0,
        motion={"rate": 1.5}, dry=(0.1, 0.1),
    ),
    "ghaffari_two_axes": lambda: _seen(
        PUBLISHED.ghaffari_two_axes(), 1e-6, 0.5e-6, (0.02, 0.015), 1e-3, 10.0
    ),
    "ghaffari_three_axes": lambda: _seen(
        PUBLISHED.ghaffari_three_axes(), 1e-6, 0.5e-6, (0.02, 0.015, 0.012), 1e-3, 10.0
    ),
    "hu_gantry": lambda: _seen(
        PUBLISHED.hu_gantry(), 0.5e-6, 0.3e-6, (0.15, 0.1), 2e-4, 20.0,
        motion={"middle": (0.0, 0.15), "duration": 2.0}, options={"law": GANTRY_SIGN},
        dry=((0.1, 0.13), (0.1, 0.13)),
    ),
    "cao_zhang_stage": lambda: _seen(
        PUBLISHED.cao_zhang_stage(), 10e-9, 20e-9, (0.02, 0.015), 1e-3, 10.0
    ),
    "cao_zhang_stage_and_scanner": lambda: _seen(
        PUBLISHED.cao_zhang_stage_and_scanner(), 10e-9, 20e-9, (0.02, 0.015, 0.01, 0.01), 1e-3,
        (10.0, 10.0, 30.0, 30.0), share=_as_printed((1.3, 1.9, 1.3, 1.9)),
    ),
    "cao_zhang_emulated_stage": lambda: _seen(
        PUBLISHED.cao_zhang_emulated_stage(), 10e-9, 20e-9, (0.02, 0.015), 1e-3, 10.0,
        dry=(0.05, 0.05),
        share=dict.fromkeys(("mass", "viscous", "stiffness"), (1.0 / 1.02, 1.0 / 0.98)),
    ),
}  # fmt: skip
"""By name of the machine, which is made when it is asked for."""
