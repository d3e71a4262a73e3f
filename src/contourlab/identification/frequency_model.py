"""A model that a frequency response fits: one mass, or two with a spring, and a delay.

    rigid       G = 1 / (M s² + B s + S)
    two_mass    G = (M_l s² + c s + k) / D on the motor,  (c s + k) / D on the load,
                D = s (M_m M_l s³ + (c M + B M_l) s² + (k M + B c) s + B k),  M = M_m + M_l

with a delay e^(-δ s), in units of the command. The command is held over a sample, so that the
response at the samples is the sum over the images of G behind a hold,

    H(ω) = Σ_n G(s_n) (1 - e^(-s_n T)) / (s_n T),    s_n = j (ω + 2π n / T)              (1)

The fit is of the relative error of H, weighted by how sure it is, by least squares; parameters that
are positive are fitted as logarithms. Two masses are tried from many resonances and on either side
of the spring, and are taken where they leave much less.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import t as student

from contourlab.errors import ConfigurationError, RecordingError
from contourlab.identification.axis_model import units_of
from contourlab.identification.frequency_response import FrequencyResponse
from contourlab.identification.result import Parameter

__all__ = ["MODELS", "FrequencyModel", "fit_frequency_response"]

MODELS = {
    "rigid": ("mass", "viscous", "delay"),
    "spring": ("mass", "viscous", "stiffness", "delay"),
    "two_mass": ("motor_mass", "load_mass", "stiffness", "damping", "motor_viscous", "delay"),
}
IMAGES = 6
"""Images of (1) on either side."""
SUREST = 5e-3
"""No frequency counts as surer than this, relative to its size."""
GOOD = 1.3
"""Misfit below which a model needs no more parameters."""
MUCH_LESS = 0.5
"""Share of the misfit that a model with more parameters has to stay below."""
SINGULAR = 1e-13
"""Eigenvalue, relative to the largest, below which rounding decides."""
TOLD = float(np.log(2.0))
"""Half an interval of a logarithm from which a parameter is not told: within a factor of two."""
SPREAD = 1.5
"""By Hann's window neighbouring frequencies tell the same: variances are that much larger."""
Rows = NDArray[Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class FrequencyModel:
    """What was fitted to one axis."""

    axis: str
    model: str
    """A key of :data:`MODELS`."""
    side: str
    """``motor`` or ``load``: where two masses are measured; ``tool`` of a rigid axis."""
    parameters: dict[str, Parameter]
    """One that the response does not tell has no value."""
    derived: dict[str, Parameter]
    """Of two masses: ``mass``, their sum, ``resonance`` and ``anti_resonance`` [Hz], and
    ``damping_ratio`` of the resonance; these may be told where the split is not."""
    misfit: float
    """Root mean square of the relative error over its standard deviation: 1 is a perfect fit."""
    frequency: Rows = field(repr=False)
    """Of the response that was fitted [Hz]."""
    response: Rows = field(repr=False)
    """Of the model there, complex."""

    def __getitem__(self, name: str) -> Parameter:
        return self.parameters[name]

    @property
    def anti_resonance_hz(self) -> float:
        """√(k / M_l) / 2π [Hz]; NaN of one mass, and where it is not told."""
        return self.derived["anti_resonance"].value if self.derived else float("nan")

    @property
    def resonance_hz(self) -> float:
        """√(k (1/M_m + 1/M_l)) / 2π [Hz]; NaN of one mass."""
        return self.derived["resonance"].value if self.derived else float("nan")


def fit_frequency_response(
    response: FrequencyResponse, *, model: str = "auto", side: str = "auto",
    confidence: float = 0.95, delay_limit: float = 0.05,
) -> FrequencyModel:  # fmt: skip
    """Return the model that fits a frequency response.

    Parameters
    ----------
    response
        With usable frequencies.
    model
        A key of :data:`MODELS`; ``auto``: the simplest that leaves hardly more than the others.
    side
        Of two masses: ``motor``, ``load``, or ``auto``.
    confidence
        Of the intervals, between 0 and 1.
    delay_limit
        Largest delay, > 0 [s].

    Raises
    ------
    RecordingError
        Fewer usable frequencies than parameters.
    ConfigurationError
        An option out of bounds.
    """
    if model not in (*MODELS, "auto"):
        raise ConfigurationError(f"model must be one of auto, {', '.join(MODELS)}, got {model!r}")
    if side not in ("auto", "motor", "load"):
        raise ConfigurationError(f"side must be auto, motor or load, got {side!r}")
    if not 0.0 < confidence < 1.0:
        raise ConfigurationError(f"confidence must be > 0 and < 1, got {confidence!r}")
    if not delay_limit > 0.0:
        raise ConfigurationError(f"delay_limit must be > 0 s, got {delay_limit!r}")
    if response.against == "nothing":
        raise RecordingError(
            f"axis {response.axis} was not swept: its reference rests, and its command is what the "
            "loop makes of noise"
        )
    use = response.usable
    f, h = response.frequency[use], response.response[use]
    if len(f) < 8:
        raise RecordingError(
            f"axis {response.axis}: {len(f)} frequencies are usable, which is too few for a model; "
            "sweep slower, further or harder"
        )
    sigma = np.maximum(response.deviation[use], SUREST)
    fitter = _Fitter(f, h, sigma, response.sample_time, delay_limit)
    names = tuple(MODELS) if model == "auto" else (model,)
    sides = ("motor", "load") if side == "auto" else (side,)
    best: _Solution | None = None
    rigid = fitter.rigid()
    for name in names:
        if name == "two_mass":
            ours = min((fitter.two_mass(one) for one in sides), key=lambda s: s.cost)
        else:
            ours = rigid if name == "rigid" else fitter.spring(rigid)
        if best is None or ours.cost < MUCH_LESS * best.cost:
            best = ours
        if best.cost < GOOD**2 * 2 * len(f):
            break
    assert best is not None
    return fitter.result(best, response, confidence)


@dataclass(frozen=True, eq=False)
class _Solution:
    model: str
    side: str
    values: Rows
    """Logarithms, and δ / T at the end."""
    cost: float
    jacobian: Rows


class _Fitter:
    def __init__(self, f: Rows, h: Rows, sigma: Rows, sample_time: float, delay: float) -> None:
        self.f, self.h, self.sigma, self.step = f, h, sigma, sample_time
        self.latest = delay / sample_time
        omega = 2.0 * np.pi * (f[:, None] + np.arange(-IMAGES, IMAGES + 1) / sample_time)
        self.s = 1j * omega
        self.hold = (1.0 - np.exp(-self.s * sample_time)) / (self.s * sample_time)

    def response(self, model: str, side: str, values: Rows) -> Rows:
        s, p = self.s, np.exp(np.clip(values[:-1], -90.0, 90.0))
        if model == "rigid":
            g = 1.0 / (p[0] * s**2 + p[1] * s)
        elif model == "spring":
            g = 1.0 / (p[0] * s**2 + p[1] * s + p[2])
        else:
            motor, load, k, c, b = p
            both = motor + load
            d = s * (
                motor * load * s**3 + (c * both + b * load) * s**2 + (k * both + b * c) * s + b * k
            )
            g = ((load * s**2 if side == "motor" else 0.0) + c * s + k) / d
        return np.asarray((g * np.exp(-values[-1] * self.step * s) * self.hold).sum(axis=1))  # (1)

    def solve(self, model: str, side: str, start: Rows) -> _Solution:
        def error(values: Rows) -> Rows:
            ratio = (self.response(model, side, values) / self.h - 1.0) / self.sigma
            # far away, where the ratio says little, its logarithm is what counts
            ratio = ratio / np.sqrt(1.0 + np.abs(ratio * self.sigma))
            return np.concatenate([ratio.real, ratio.imag])

        low = np.full(len(start), -np.inf)
        high = np.full(len(start), np.inf)
        low[-1], high[-1] = -1.0, self.latest
        found = least_squares(error, np.clip(start, low, high), bounds=(low, high), max_nfev=80)
        return _Solution(model, side, found.x, float(2.0 * found.cost), found.jac)

    def rigid(self) -> _Solution:
        w = 2.0 * np.pi * self.f
        size = np.abs(1.0 / self.h)
        mass, viscous = self.low_frequency()
        tries = [
            (mass, viscous),
            (mass, mass * w[0]),
            (float(np.median(size / w)) / w[-1], float(np.median(size / w))),
        ]
        starts = [np.array([np.log(m), np.log(b), 0.5]) for m, b in tries]
        return min((self.solve("rigid", "tool", s) for s in starts), key=lambda x: x.cost)

    def low_frequency(self) -> tuple[float, float]:
        """Return mass and viscous friction that 1/H = -M ω² + j B ω has where ω is low."""
        n = max(8, len(self.f) // 4)
        w, inverse = 2.0 * np.pi * self.f[:n], 1.0 / self.h[:n]
        weight = 1.0 / (np.abs(inverse) * self.sigma[:n]) ** 2
        square = float(np.sum(weight * w**4))
        mass = float(np.sum(weight * -inverse.real * w**2)) / square
        viscous = float(np.sum(weight * inverse.imag * w) / np.sum(weight * w**2))
        typical = float(np.median(np.abs(inverse) / w**2))
        if not 0.1 * typical < mass < 10.0 * typical:
            mass = typical
        return mass, max(viscous, 0.02 * mass * float(w[0]))

    def spring(self, rigid: _Solution) -> _Solution:
        w = 2.0 * np.pi * self.f
        low = float(np.abs(1.0 / self.h[0]))
        starts = [
            np.array([np.log(low / w0**2), np.log(low / w0), np.log(low), 0.5])
            for w0 in (w[0] * 2, np.sqrt(w[0] * w[-1]), w[-1])
        ]
        starts.append(
            np.array([*rigid.values[:2], np.log(1e-3 * np.exp(rigid.values[0]) * w[0] ** 2), 0.5])
        )
        return min((self.solve("spring", "tool", s) for s in starts), key=lambda x: x.cost)

    def two_mass(self, side: str) -> _Solution:
        mass, viscous = self.low_frequency()
        best: _Solution | None = None
        low = max(self.f[0] * 2.0, 1.0)
        for anti in np.geomspace(low, self.f[-1], 7):
            for ratio in (0.2, 1.0):
                load, motor = mass * ratio / (1.0 + ratio), mass / (1.0 + ratio)
                k = load * (2.0 * np.pi * anti) ** 2
                reduced = motor * load / (motor + load)
                c = 2.0 * 0.03 * np.sqrt(k * reduced)
                start = np.array([*np.log([motor, load, k, c, viscous]), 0.5])
                ours = self.solve("two_mass", side, start)
                if best is None or ours.cost < best.cost:
                    best = ours
        assert best is not None
        return best

    def result(
        self, found: _Solution, response: FrequencyResponse, confidence: float
    ) -> FrequencyModel:
        n = 2 * len(self.f)
        free = max(n - len(found.values), 1)
        variance = SPREAD * max(found.cost / free, 1.0)
        products = found.jacobian.T @ found.jacobian
        size = np.sqrt(np.maximum(np.diagonal(products), 1e-300))
        values, turned = np.linalg.eigh(products / np.outer(size, size))
        # a direction that is not told is not sure, which leaving it out would say
        values = np.maximum(values, SINGULAR * values[-1])
        covariance = turned / values @ turned.T / np.outer(size, size) * variance
        half = float(student.ppf(0.5 + 0.5 * confidence, max(free / (2 * SPREAD), 1.0)))
        units = _units(response.command_kind)

        def parameter(value: float, gradient: Rows, unit: str, late: bool = False) -> Parameter:
            """Of a logarithm, or a delay in samples."""
            width = half * float(np.sqrt(max(gradient @ covariance @ gradient, 0.0)))
            ends = [value, value - width, value + width]
            if late:
                ends = [self.step * end for end in ends]
            else:
                ends = [np.nan] * 3 if width > TOLD else [float(np.exp(end)) for end in ends]
            return Parameter(value=ends[0], low=ends[1], high=ends[2], unit=unit)

        each = np.eye(len(found.values))
        parameters = {
            name: parameter(float(found.values[k]), each[k], units[name], name == "delay")
            for k, name in enumerate(MODELS[found.model])
        }
        derived = {}
        if found.model == "two_mass":
            motor, load, k, c = np.exp(found.values[:4])
            part = load / (motor + load)
            inverse = np.log(1.0 / motor + 1.0 / load)
            of_inverse = np.array([-part, part - 1.0, 0.0, 0.0, 0.0, 0.0])
            hertz = np.log(2.0 * np.pi)
            for name, value, gradient, unit in (
                ("mass", np.log(motor + load), (1.0 - part) * each[0] + part * each[1],
                 units["mass"]),
                ("resonance", 0.5 * (np.log(k) + inverse) - hertz,
                 0.5 * (each[2] + of_inverse), "Hz"),
                ("anti_resonance", 0.5 * np.log(k / load) - hertz, 0.5 * (each[2] - each[1]), "Hz"),
                ("damping_ratio", np.log(0.5 * c) + 0.5 * (inverse - np.log(k)),
                 each[3] + 0.5 * (of_inverse - each[2]), "1"),
            ):  # fmt: skip
                derived[name] = parameter(float(value), gradient, unit)
            share = ("motor_mass", "load_mass", "stiffness")
            if found.side == "load" and not all(parameters[name].identified for name in share):
                # on the way to a load without mass the rest of the split only seems to be sure
                for some, names in (
                    (parameters, (*share, "damping", "delay")),
                    (derived, ("anti_resonance", "damping_ratio")),
                ):
                    for name in names:
                        unit = some[name].unit
                        some[name] = Parameter(value=np.nan, low=np.nan, high=np.nan, unit=unit)
        return FrequencyModel(
            axis=response.axis, model=found.model, side=found.side, parameters=parameters,
            derived=derived,
            misfit=float(np.sqrt(found.cost / free)), frequency=self.f,
            response=self.response(found.model, found.side, found.values),
        )  # fmt: skip


def _units(kind: str) -> dict[str, str]:
    of = units_of(kind)
    return {
        "mass": of["mass"], "motor_mass": of["mass"], "load_mass": of["mass"],
        "viscous": of["viscous"], "motor_viscous": of["viscous"], "damping": of["viscous"],
        "stiffness": of["stiffness"], "delay": "s",
    }  # fmt: skip
