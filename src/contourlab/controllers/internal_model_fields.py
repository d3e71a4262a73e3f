"""From the fields of :class:`InternalModelContouring` to the numbers of the bound law, checked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import is_concrete
from contourlab.controllers.position_domain_law import check_conversion
from contourlab.controllers.pulse_model import PulseModel
from contourlab.controllers.stabiliser import closed_loop, design_stabiliser
from contourlab.controllers.stabiliser_certificate import WIDEST, certify_gain, worst_radius
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.typing import Scalar

if TYPE_CHECKING:
    from contourlab.controllers.internal_model_contouring import InternalModelContouring

__all__ = [
    "SlaveDisturbances",
    "bound_model",
    "bound_stabiliser",
    "check_fields",
    "is_off",
    "slave_disturbances",
]

ON_CIRCLE = 1e-6
"""How near to the unit circle a zero of an axis may come."""
RANGE = 0.01
"""Half width of the box of α, unless another is given."""
INTEGRATES = 1e-9
"""|A(1)| relative to its coefficients below which an axis is held by nothing."""
DECAY = 0.6
"""ρ of gains that are found, unless another is given."""


def check_fields(law: InternalModelContouring) -> None:
    """Raise ConfigurationError if fields that go together are not given together.

    Parameters
    ----------
    law
        The configuration.
    """
    identified = {
        name: getattr(law, name) for name in ("numerator", "denominator", "identified_at")
    }
    missing = [name for name, value in identified.items() if value is None]
    if missing and len(missing) < 3:
        raise ConfigurationError(
            "an identified model needs numerator, denominator and identified_at, "
            f"{', '.join(missing)} not given"
        )
    if not missing:
        shapes = {np.shape(np.asarray(identified[name])) for name in ("numerator", "denominator")}
        shape = next(iter(shapes))
        if len(shapes) > 1 or len(shape) != 2 or shape[0] != law.axis.n_axes or shape[1] < 2:
            raise ConfigurationError(
                f"numerator and denominator must have one shape, ({law.axis.n_axes}, n) with "
                f"n >= 2, got {np.shape(np.asarray(law.numerator))} and "
                f"{np.shape(np.asarray(law.denominator))}"
            )
    check_conversion(law.conversion, law.turning_width)
    if law.offset is not None and law.second_signal not in ("best", "position"):
        raise ConfigurationError(
            "offset is added to the position as second signal, and second_signal is "
            f"{law.second_signal!r}; remove it"
        )
    observer = law.disturbance_observer_hz
    if observer is None or is_off(observer):
        state = "not given" if observer is None else "0"
        for name, idle in (
            ("disturbance_frequencies_hz", law.disturbance_frequencies_hz is None),
            (f"reject_on = {law.reject_on!r}", law.reject_on == "all"),
        ):
            if not idle:
                raise ConfigurationError(
                    f"{name} goes with disturbance_observer_hz, which is {state}"
                )
    if law.disturbance_frequencies_hz is not None and np.ndim(law.disturbance_frequencies_hz) != 1:
        raise ConfigurationError(
            "disturbance_frequencies_hz must be a list, got shape "
            f"{np.shape(law.disturbance_frequencies_hz)}"
        )


def bound_model(law: InternalModelContouring, sample_time: Scalar) -> PulseModel:
    """Return the pulse transfer functions of all axes at a sample time.

    Parameters
    ----------
    law
        The configuration.
    sample_time
        T [s].

    Raises
    ------
    ConfigurationError
        An identified model of another sample time.
    RefusedError
        A zero on or outside the unit circle, or a command that acts a sample late.
    """
    if law.numerator is None or law.denominator is None or law.identified_at is None:
        model = PulseModel.of_model(law.axis.model, sample_time)
    else:
        period = float(np.asarray(law.identified_at))
        if abs(float(np.asarray(sample_time)) - period) > 1e-9 * period:
            raise ConfigurationError(
                f"the pulse transfer functions were identified at {period:g} s and hold there "
                f"only, the loop runs at {float(np.asarray(sample_time)):g} s"
            )
        model = PulseModel(denominator=law.denominator, numerator=law.numerator)
    if not is_concrete(model.numerator):
        return model
    for axis, b in enumerate(np.asarray(model.numerator)):
        if not abs(b[0]) > 1e-9 * np.max(np.abs(b)):
            raise RefusedError(
                f"axis {axis} answers to a command two samples later or more (b_1 = {b[0]:.3g}): "
                "the internal model looks one sample ahead only"
            )
        zeros = np.roots(b)
        if zeros.size and np.max(np.abs(zeros)) > 1.0 - ON_CIRCLE:
            worst = zeros[int(np.argmax(np.abs(zeros)))]
            raise RefusedError(
                f"the internal model inverts the zeros of an axis, and axis {axis} has one at "
                f"{worst:.6g}, on or outside the unit circle. Sampled models have such a zero "
                "where three or more integrations or lags stand in a row; leave the fast lag out "
                "of the model, or sample more slowly"
            )
    return model


class SlaveDisturbances(NamedTuple):
    """What is observed of the disturbances at the slaves' inputs."""

    known: NDArray[Any]
    """Frequencies of what is observed, 0 for a constant, shape (n,) [Hz]; empty if nothing is."""
    bandwidth: Any
    """Of the observers [Hz]; of no effect where nothing is observed."""
    fact: str = ""
    """What the recording says of a bandwidth that was not given."""
    warning: str = ""
    """Of slaves whose copy runs away from them."""


def slave_disturbances(
    law: InternalModelContouring, slaves: tuple[int, ...], model: PulseModel
) -> SlaveDisturbances:
    """Return what the slaves' disturbance observers observe, and at which bandwidth.

    Without one, the copy of an axis that nothing holds runs away from it under any push: the paper
    asks for axes that are asymptotically stable, or are made so (Assumption 2.1). There it is on
    by default.

    Parameters
    ----------
    law
        The configuration.
    slaves
        Which axes.
    model
        Of them.
    """
    concrete = is_concrete(model.denominator)
    a = np.asarray(model.denominator) if concrete else np.ones((len(slaves), 1))
    free = np.abs(1.0 + a.sum(1)) <= INTEGRATES * (1.0 + np.abs(a).sum(1))
    names = ", ".join(str(k) for k, moves in zip(slaves, free, strict=True) if moves)
    said = f"axis {names}: no stiffness, by the model"
    given = law.disturbance_observer_hz
    if is_off(given) or (given is None and not names):
        warning = (
            f"{said}; under dry friction or any other push that it does not know, the copy of the "
            "axis in the internal model runs away from the axis until the command is at its "
            "limit; give disturbance_observer_hz, or leave it out"
        )
        return SlaveDisturbances(np.zeros(0), 1.0, warning=warning if names else "")
    extra = law.disturbance_frequencies_hz
    known = np.append(0.0, np.zeros(0) if extra is None else extra)
    if given is not None:
        return SlaveDisturbances(known, given)
    hz = law.master_observer_hz
    return SlaveDisturbances(known, hz, f"{float(np.asarray(hz)):g} Hz on the slaves; {said}")


def is_off(bandwidth: Any) -> bool:
    """Return whether a bandwidth was given as 0, for none.

    Parameters
    ----------
    bandwidth
        Or None, where none was given [Hz].
    """
    return bandwidth is not None and is_concrete(bandwidth) and float(np.asarray(bandwidth)) == 0.0


def bound_stabiliser(law: InternalModelContouring, model: PulseModel) -> dict[str, Any]:
    """Return the gains of the slaves and what they are certified for.

    Parameters
    ----------
    law
        The configuration.
    model
        Of the slaves.

    Raises
    ------
    ConfigurationError
        A gain of another shape, or no solver.
    RefusedError
        No gain is certified, or the one that was given is not stable.
    """
    if law.stabiliser_gain is not None:
        return _as_given(law, np.asarray(law.stabiliser_gain), np.asarray(model.numerator))
    width = RANGE if law.stabiliser_range is None else float(np.asarray(law.stabiliser_range))
    decay = DECAY if law.stabiliser_decay is None else float(np.asarray(law.stabiliser_decay))
    numerators = np.asarray(model.numerator)
    least = law.stabiliser_decay is not None
    designs = [
        design_stabiliser(b, half_width=width, decay=decay, least_gain=least) for b in numerators
    ]
    radii = [
        max(
            float(np.max(np.abs(np.linalg.eigvals(closed_loop((end, second), b, gain)))))
            for end, gain in zip((design.low, design.high), design.gain, strict=True)
            for second in (1.0 - width, 1.0 + width)
        )
        for b, design in zip(numerators, designs, strict=True)
    ]
    return {
        "gain": np.stack([d.gain for d in designs], 1),
        "low": np.array([d.low for d in designs]), "high": np.array([d.high for d in designs]),
        "half_width": np.array([d.half_width for d in designs]),
        "certificate": np.array([d.margin for d in designs]), "radius": np.array(radii),
    }  # fmt: skip


def _as_given(
    law: InternalModelContouring, gain: NDArray[Any], numerators: NDArray[Any]
) -> dict[str, Any]:
    """Return gains that were given, stable at the corners of the range, with their certificate."""
    n_slaves, order = numerators.shape
    if gain.shape not in ((order,), (n_slaves, order)):
        raise ConfigurationError(
            f"stabiliser_gain must have {order} values for each of the {n_slaves} slaves, or "
            f"{order} for all, got shape {gain.shape}"
        )
    asked = None if law.stabiliser_range is None else float(np.asarray(law.stabiliser_range))
    bound = 1.0 if law.stabiliser_decay is None else float(np.asarray(law.stabiliser_decay))
    rows = np.broadcast_to(gain, (n_slaves, order))
    certificates, radii = [], []
    for slave, (b, row) in enumerate(zip(numerators, rows, strict=True)):
        radius, where = worst_radius(b, row, RANGE if asked is None else asked)
        if not radius < bound:
            raise RefusedError(
                f"stabiliser_gain of slave {slave + 1} gives a loop with a spectral radius of "
                f"{radius:.4g} at alpha = ({where[0]:.4g}, {where[1]:.4g}), where it must be < "
                f"{bound:g}: it does not stabilise the axis over the range of "
                f"{RANGE if asked is None else asked:g} about (-2, 1)"
            )
        radii.append(radius)
        certificates.append(certify_gain(b, row, at_most=WIDEST if asked is None else asked))
    none = np.full(n_slaves, -2.0)
    return {
        "gain": np.broadcast_to(gain, (2, n_slaves, order)).copy(),
        "low": none, "high": none.copy(),
        "half_width": np.array([c.half_width for c in certificates]),
        "certificate": np.array([c.margin for c in certificates]), "radius": np.array(radii),
    }  # fmt: skip
