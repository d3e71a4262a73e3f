"""Conformance of a control law: what it promises to the loop, to sweeps and to the export."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import replace_at
from contourlab.contours.base import Contour
from contourlab.contours.circle import Circle
from contourlab.contours.line import Line
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.errors import ContourlabError, RefusedError
from contourlab.recordings.reference import Reference
from contourlab.recordings.sample import Sample
from contourlab.testing.protocol import (
    check_frozen,
    check_needs,
    check_pure,
    check_state,
    check_traced,
    compiled_run,
    fields_below,
    float_leaves,
    outputs,
    run,
)
from contourlab.testing.samples import make_samples, sample_at

__all__ = ["check_controller"]

N_SAMPLES = 60


def check_controller(
    controller: Controller,
    *,
    contour: Contour | None = None,
    sample_time: float = 1e-3,
    reference: Reference | None = None,
    inert: Collection[str] = (),
) -> None:
    """Assert that a control law keeps the contract of ``contourlab.controllers``.

    It is frozen; its needs are static; ``bind`` works or refuses with a reason; the bound law is
    pure, can be scanned, gives the same numbers traced and not, over a batch and one by one, and
    right derivatives with respect to every real leaf (by finite differences: give gains that keep
    the command within its limit for tracking errors of 20 µm); it stands an error of zero and NaN
    from a sensor; every field of its configuration changes something.

    Parameters
    ----------
    controller
        The law, configured so that every field matters: no gain at zero.
    contour
        What to follow; by default a line and a circle with one coordinate per axis.
    sample_time
        [s].
    reference
        What to follow, of 60 samples; needed where axes are not the coordinates of the contour.
    inert
        Dotted paths of the fields that are known to change no command, such as
        ``"model.coulomb"``; a field named here that does change something is an error.

    Raises
    ------
    AssertionError
        Something does not hold; says what.
    """
    name = type(controller).__name__
    check_frozen(controller)
    check_needs(controller)
    assert isinstance(controller.needs, Needs), f"{name}.needs must be Needs"
    taken: list[tuple[Contour, Sample]] = []
    for path in default_contours(controller.n_axes) if contour is None else [contour]:
        try:
            law = controller.bind(path, sample_time)
        except RefusedError as refusal:
            reason = str(refusal)
            if len(reason) < 10:
                raise AssertionError(f"{name} refuses a contour without a reason") from refusal
            continue
        samples = make_samples(path, N_SAMPLES, sample_time, controller.needs, reference=reference)
        _check_bound(controller, law, path, samples, sample_time, reference)
        taken.append((path, samples))
    assert taken, f"{name} refuses every contour that it was offered"
    path, samples = taken[-1]
    _check_numbers(controller, path, samples, sample_time)
    _check_fields(controller, path, samples, sample_time, inert)


def default_contours(n_coordinates: int) -> list[Contour]:
    """Return a line and, where there is one, a circle.

    Parameters
    ----------
    n_coordinates
        Number of coordinates.
    """
    direction = np.cos(0.6 + np.arange(n_coordinates))
    contours: list[Contour] = [Line(start=0.01 * direction[::-1], end=0.03 * direction)]
    if n_coordinates == 2:
        contours.append(Circle(radius=np.array(0.02), center=np.array([0.01, -0.005])))
    if n_coordinates == 3:
        contours.append(
            Circle(
                radius=np.array(0.02),
                center=np.array([0.0, 0.01, 0.0]),
                normal=np.array([0.2, -0.3, 1.0]),
            )
        )
    return contours


def _check_bound(
    controller: Controller,
    law: BoundController,
    contour: Contour,
    samples: Sample,
    sample_time: float,
    reference: Reference | None,
) -> None:
    name = type(controller).__name__
    n_axes = controller.n_axes
    assert isinstance(law, BoundController), f"{name}.bind must return a BoundController"
    check_state(law, samples, n_axes)
    check_pure(law, samples)
    check_traced(law, samples)
    commands, state = compiled_run(law, samples)
    assert np.all(np.isfinite(commands)), f"{name} gives a command that is not finite"
    _check_reports(law, state)
    still = make_samples(
        contour, N_SAMPLES, sample_time, controller.needs,
        error=np.zeros(n_axes), reference=reference,
    )  # fmt: skip
    commands, _ = compiled_run(law, still)
    assert np.all(np.isfinite(commands)), f"{name} gives no finite command at zero tracking error"
    first = sample_at(samples, 0)
    lost = Sample(
        time=first.time, reference=first.reference, geometry=first.geometry, preview=first.preview,
        position=jnp.full(n_axes, jnp.nan), velocity=jnp.full(n_axes, jnp.nan),
    )  # fmt: skip
    command, after = _first_step(law, first, lost)
    assert jnp.shape(command) == (n_axes,), f"{name} loses the shape of its command to NaN"
    _check_reports(law, after)


@jax.jit
def _first_step(law: BoundController, first: Sample, sample: Sample) -> tuple[Any, Any]:
    return law.step(law.init(first), sample)


def _check_reports(law: BoundController, state: Any) -> None:
    name = type(law).__name__
    telemetry = law.telemetry(state)
    for key, value in telemetry.items():
        assert isinstance(key, str), f"{name}: the names of telemetry must be text"
        assert isinstance(value, jax.Array | np.ndarray), f"{name}: {key!r} must be an array"
    status = jnp.asarray(law.status(state))
    assert status.shape == (), f"{name}.status must be one int32"
    assert status.dtype == np.int32, f"{name}.status must be one int32"
    assert 0 <= int(status) < len(law.statuses), f"{name}.status {int(status)} has no name"
    assert law.statuses[0] == "normal", f"{name}.statuses must begin with normal"
    finished = jnp.asarray(law.finished(state))
    assert finished.shape == (), f"{name}.finished must be one bool"
    assert finished.dtype == bool, f"{name}.finished must be one bool"


def _weights(n_axes: int) -> Any:
    return np.random.default_rng(7).normal(size=(N_SAMPLES, n_axes))


def _commands(
    controller: Controller, contour: Contour, samples: Sample, sample_time: float
) -> tuple[Any, Any]:
    """Return what to differentiate and a function from it to the commands."""
    if controller.needs.host_synthesis:
        return controller.bind(contour, sample_time), lambda law: run(law, samples)[0]
    return controller, lambda law: run(law.bind(contour, sample_time), samples)[0]


def _check_numbers(
    controller: Controller, contour: Contour, samples: Sample, sample_time: float
) -> None:
    """Check derivatives with respect to every number of the law, and batches of laws."""
    subject, commands = _commands(controller, contour, samples, sample_time)
    named, rebuild = float_leaves(subject)
    of_leaves = jax.jit(lambda leaves: commands(rebuild(leaves)))
    _check_derivatives(controller, named, of_leaves)
    _check_batch(controller, named, of_leaves)


def _check_derivatives(controller: Controller, named: list[Any], commands: Any) -> None:
    name = type(controller).__name__
    values = [leaf for _, leaf in named]
    weights = _weights(controller.n_axes)

    def value(leaves: list[Any]) -> Any:
        return jnp.sum(weights * commands(leaves))

    backward = jax.jit(jax.grad(value))(values)
    forward_of = jax.jit(lambda leaves, along: jax.jvp(value, (leaves,), (along,))[1])
    size = float(jnp.sum(jnp.abs(weights * commands(values))))
    for k, (path, leaf) in enumerate(named):
        where = f"the derivative of {name} with respect to {path}"
        assert np.all(np.isfinite(backward[k])), f"{where} is not finite"
        if leaf.size == 0 or not np.all(np.isfinite(leaf)):
            continue
        direction = np.where(leaf == 0.0, 1.0, leaf)
        along = [np.zeros_like(v) for v in values]
        along[k] = direction
        forward = float(forward_of(values, along))
        reverse = float(np.sum(backward[k] * direction))
        step = 1e-5
        shifted = []
        for sign in (1.0, -1.0):
            moved = list(values)
            moved[k] = leaf + sign * step * direction
            shifted.append(float(value(moved)))
        difference = (shifted[0] - shifted[1]) / (2.0 * step)
        # rounding of the difference of sums of this size, and its second-order error
        tolerance = 1e-9 * size + 1e-5 * abs(difference)
        assert abs(forward - reverse) <= 1e-9 * (size + abs(forward)), (
            f"{where}: forward {forward:.9g}, reverse {reverse:.9g}"
        )
        assert abs(forward - difference) <= tolerance, (
            f"{where}: {forward:.9g}, by finite differences {difference:.9g}"
        )


def _check_batch(controller: Controller, named: list[Any], commands: Any) -> None:
    factors = (1.0, 1.01, 0.99)
    batch = [np.stack([leaf * factor for factor in factors]) for _, leaf in named]
    together = jax.jit(jax.vmap(commands))(batch)
    for k, factor in enumerate(factors):
        alone = np.asarray(commands([leaf * factor for _, leaf in named]))
        scale = max(1e-300, float(np.max(np.abs(alone))))
        np.testing.assert_allclose(
            together[k], alone, rtol=0.0, atol=1e-9 * scale,
            err_msg=f"{type(controller).__name__} differs in a batch",
        )  # fmt: skip


def _check_fields(
    controller: Controller,
    contour: Contour,
    samples: Sample,
    sample_time: float,
    inert: Collection[str],
) -> None:
    name = type(controller).__name__

    def observe(law: Controller) -> tuple[Needs, Any]:
        # a change of what is needed is a change already; the samples then no longer fit
        if law.needs != controller.needs:
            return law.needs, None
        return law.needs, np.asarray(outputs(law.bind(contour, sample_time), samples))

    needs, base = observe(controller)
    peak = float(np.max(np.abs(base)))

    def matters(path: str, value: Any) -> bool | None:
        try:
            other_needs, other = observe(replace_at(controller, path, value))
        except ContourlabError:
            return None
        return other_needs != needs or float(np.max(np.abs(other - base))) > 1e-12 * peak

    paths = []
    for path, kind, rule, value in fields_below(controller):
        paths.append(path)
        others = _others(kind, rule, value, peak)
        if not others:
            continue
        effects = (matters(path, other) for other in others)  # until one does
        if path in inert:
            assert not any(effects), f"{name}.{path} is declared inert, yet it changes the command"
        elif kind == "choice":
            # a choice that is refused, with a reason, is not ignored either
            assert any(e is not False for e in effects), f"{name}.{path} changes nothing"
        else:
            assert any(effects), f"{name}.{path} changes nothing: declare it inert or remove it"
    unknown = set(inert) - set(paths)
    assert not unknown, f"{name} has no field {', '.join(sorted(unknown))}"


def _others(kind: str, rule: Any, value: Any, peak: float) -> list[Any]:
    """Return other values for a field, of which one at least should change something."""
    if kind == "real":
        value = np.asarray(value)
        finite = np.where(np.isfinite(value), value, peak)
        return [0.8 * finite, 1.25 * finite, np.full_like(finite, 0.5 * peak), finite + 0.5]
    if rule["allowed"] is not None:
        return [other for other in rule["allowed"] if other != value]
    if rule["minimum"] is not None:
        return [value + 1]
    return [not value] if isinstance(value, bool) else []
