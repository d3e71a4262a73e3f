"""What laws and estimators have in common: pure functions of a state that can be scanned."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import Configuration
from contourlab.recordings.sample import Sample
from contourlab.testing.samples import sample_at

__all__ = [
    "check_frozen",
    "check_needs",
    "check_pure",
    "check_state",
    "check_traced",
    "compiled_run",
    "fields_below",
    "float_leaves",
    "outputs",
    "run",
]

STATE_TYPES = (np.dtype(np.float64), np.dtype(np.int32))
UNTRACED_STEPS = 6


def run(law: Any, samples: Sample) -> tuple[jax.Array, Any]:
    """Return the outputs of a law over stacked samples, and its last state; open loop.

    Parameters
    ----------
    law
        A bound control law or an estimator.
    samples
        Stacked.
    """
    first = sample_at(samples, 0)

    def step(state: Any, sample: Sample) -> tuple[Any, Any]:
        output, state = law.step(state, sample)
        return state, output

    state, outputs = jax.lax.scan(step, law.init(first), jax.tree.map(jnp.asarray, samples))
    return outputs, state


compiled_run = jax.jit(run)
"""``run``, compiled once for each kind of law."""


def outputs(law: Any, samples: Sample) -> jax.Array:
    """Return the outputs of a law over stacked samples, compiled.

    Parameters
    ----------
    law
        A bound control law or an estimator.
    samples
        Stacked.
    """
    return compiled_run(law, samples)[0]  # type: ignore[no-any-return]


def check_frozen(configuration: Any) -> None:
    """Assert that no field of a configuration can be set.

    Parameters
    ----------
    configuration
        Any.
    """
    name = type(configuration).__name__
    assert isinstance(configuration, Configuration), f"{name} is not a Configuration"
    for field in dataclasses.fields(configuration):
        try:
            setattr(configuration, field.name, getattr(configuration, field.name))
        except AttributeError:  # FrozenInstanceError is one
            continue
        raise AssertionError(f"{name}.{field.name} can be set: it must be frozen")


def check_needs(configuration: Any) -> None:
    """Assert that ``needs`` is static, hashable and the same each time.

    Parameters
    ----------
    configuration
        A controller or an estimator.
    """
    name = type(configuration).__name__
    needs = configuration.needs
    assert not jax.tree.leaves(needs), f"{name}.needs must hold no arrays"
    assert hash(needs) == hash(configuration.needs), f"{name}.needs must have one hash"
    assert needs == configuration.needs, f"{name}.needs must be equal each time it is asked"


def check_state(law: Any, samples: Sample, n_outputs: int) -> None:
    """Assert that a law can be scanned: one structure, float64 and int32 only.

    Parameters
    ----------
    law
        A bound control law or an estimator.
    samples
        Stacked.
    n_outputs
        Length of what ``step`` returns.
    """
    # shapes and types are known when it is traced: nothing is compiled
    jax.eval_shape(lambda first: _check_types(law, first, n_outputs), sample_at(samples, 0))


def _check_types(law: Any, first: Sample, n_outputs: int) -> None:
    name = type(law).__name__
    before = law.init(first)
    output, after = law.step(before, first)
    assert jnp.shape(output) == (n_outputs,), (
        f"{name}.step must return shape ({n_outputs},), got {jnp.shape(output)}"
    )
    assert output.dtype == np.float64, f"{name}.step must return float64, got {output.dtype}"
    old, new = str(jax.tree.structure(before)), str(jax.tree.structure(after))
    assert old == new, f"{name}.step changes the structure of the state: {old} became {new}"
    for path, leaf in jax.tree_util.tree_leaves_with_path(before):
        where = f"state{jax.tree_util.keystr(path)} of {name}"
        assert isinstance(leaf, jax.Array | np.ndarray), f"{where} must be an array, got {leaf!r}"
        assert leaf.dtype in STATE_TYPES, f"{where} must be float64 or int32, got {leaf.dtype}"
    for (path, a), b in zip(
        jax.tree_util.tree_leaves_with_path(before), jax.tree.leaves(after), strict=True
    ):
        where = f"state{jax.tree_util.keystr(path)} of {name}"
        assert jnp.shape(a) == jnp.shape(b), f"{where}: {jnp.shape(a)} became {jnp.shape(b)}"
        assert a.dtype == b.dtype, f"{where}: {a.dtype} became {b.dtype}"


def check_pure(law: Any, samples: Sample) -> None:
    """Assert that the same input gives the same output and that a step leaves its input alone.

    Parameters
    ----------
    law
        A bound control law or an estimator.
    samples
        Stacked.
    """
    name = type(law).__name__
    _, state = compiled_run(law, samples)
    sample = sample_at(samples, 3)
    held = [np.array(leaf) for leaf in jax.tree.leaves((law, state, sample))]
    once, twice = (jax.tree.leaves(_traced_anew(law, state, sample)) for _ in range(2))
    for a, b in zip(once, twice, strict=True):
        assert np.array_equal(a, b, equal_nan=True), f"{name}.step gives two answers to one input"
    # with the law's own arrays, which could be written to
    jax.eval_shape(lambda: law.step(state, sample))
    for leaf, kept in zip(jax.tree.leaves((law, state, sample)), held, strict=True):
        assert np.array_equal(leaf, kept, equal_nan=True), f"{name}.step changes what it is given"


def _traced_anew(law: Any, state: Any, sample: Sample) -> Any:
    """Return what a step gives, traced for this call: what Python remembers shows itself."""
    return jax.jit(lambda law, state, sample: law.step(state, sample))(law, state, sample)


def check_traced(law: Any, samples: Sample) -> None:
    """Assert that a law gives the same numbers traced and not traced, up to rounding.

    Parameters
    ----------
    law
        A bound control law or an estimator.
    samples
        Stacked.
    """
    short = jax.tree.map(lambda x: x[:UNTRACED_STEPS], samples)
    traced = np.asarray(outputs(law, samples))[:UNTRACED_STEPS]
    name = type(law).__name__
    assert np.all(np.isfinite(traced)), f"{name} gives a number that is not finite"
    with jax.disable_jit():
        state, untraced = law.init(sample_at(short, 0)), []
        for k in range(UNTRACED_STEPS):
            output, state = law.step(state, sample_at(short, k))
            untraced.append(np.asarray(output))
    scale = max(1e-300, float(np.max(np.abs(traced))))
    # fused multiply-adds and another order of sums: some rounding, amplified by differences
    np.testing.assert_allclose(
        traced, np.stack(untraced), rtol=0.0, atol=1e-9 * scale,
        err_msg=f"{name} differs when traced",
    )  # fmt: skip


def float_leaves(tree: Any) -> tuple[list[tuple[str, Any]], Callable[[list[Any]], Any]]:
    """Return the float leaves of a tree with their paths, and how to rebuild it from others.

    Parameters
    ----------
    tree
        Any.
    """
    everything, structure = jax.tree_util.tree_flatten_with_path(tree)
    real = [np.asarray(leaf).dtype.kind == "f" for _, leaf in everything]
    named = [
        (jax.tree_util.keystr(path).lstrip("."), np.asarray(leaf))
        for (path, leaf), is_real in zip(everything, real, strict=True)
        if is_real
    ]

    def rebuild(leaves: list[Any]) -> Any:
        given = iter(leaves)
        return jax.tree.unflatten(
            structure,
            [next(given) if r else leaf for (_, leaf), r in zip(everything, real, strict=True)],
        )

    return named, rebuild


def fields_below(configuration: Any, prefix: str = "") -> Iterator[tuple[str, str, Any, Any]]:
    """Yield dotted path, kind ("real" or "choice"), rule and value of every field.

    Parameters
    ----------
    configuration
        A configuration, or a tuple of them.
    prefix
        Path of the configuration.
    """
    if isinstance(configuration, tuple):
        for k, item in enumerate(configuration):
            yield from fields_below(item, f"{prefix}{k}.")
        return
    if not isinstance(configuration, Configuration):
        return
    for field in dataclasses.fields(configuration):
        value = getattr(configuration, field.name)
        if not field.init or value is None:
            continue
        for kind in ("real", "choice"):
            if kind in field.metadata:
                yield prefix + field.name, kind, field.metadata[kind], value
                break
        else:
            yield from fields_below(value, f"{prefix}{field.name}.")
