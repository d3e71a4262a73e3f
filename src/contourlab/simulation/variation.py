"""Lanes: which values differ between the runs of a batch, and where in the loop they stand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import replace_at, resolve
from contourlab.errors import SimulationError, choices

__all__ = ["HashableTree", "lane_seeds", "lane_values", "mapped_axes", "varied"]


class HashableTree(tuple[Any, ...]):
    """A pytree of ``in_axes`` as a static, hashable argument."""

    @staticmethod
    def of(tree: Any) -> HashableTree:
        """Return a tree whose leaves are hashable, None being a leaf, as one hashable value.

        Parameters
        ----------
        tree
            Any pytree.
        """
        leaves, structure = jax.tree.flatten(tree, is_leaf=lambda x: x is None)
        return HashableTree((tuple(leaves), structure))

    def tree(self) -> Any:
        """Return the tree itself."""
        return jax.tree.unflatten(self[1], self[0])


def lane_values(vary: Mapping[str, Any]) -> tuple[int, dict[str, NDArray[Any]]]:
    """Return the number of lanes and the values as arrays.

    Parameters
    ----------
    vary
        Values by path; the first dimension is the lane.

    Raises
    ------
    SimulationError
        Nothing to vary, no numbers, or different numbers of lanes.
    """
    values = {path: np.asarray(value) for path, value in vary.items()}
    if not values:
        raise SimulationError("vary names nothing to vary")
    for path, value in values.items():
        if value.ndim == 0:
            raise SimulationError(f"vary: {path} needs one value per lane, got a single number")
        if value.dtype.kind not in "iuf":
            raise SimulationError(f"vary: {path} must hold numbers")
    lengths = {path: len(value) for path, value in values.items()}
    if len(set(lengths.values())) != 1 or 0 in lengths.values():
        shown = ", ".join(f"{path} has {length}" for path, length in lengths.items())
        raise SimulationError(f"vary is zipped: every path needs as many values (>= 1), {shown}")
    return next(iter(lengths.values())), values


def lane_seeds(values: Mapping[str, NDArray[Any]], seed: int, lanes: int) -> NDArray[Any]:
    """Return the seed of every lane.

    Parameters
    ----------
    values
        As ``lane_values`` returned them.
    seed
        Of lane 0 if seeds are not varied.
    lanes
        How many.

    Raises
    ------
    SimulationError
        Seeds that are no whole numbers.
    """
    seeds = values.get("seed", seed + np.arange(lanes))
    if seeds.dtype.kind not in "iu" or seeds.ndim != 1:
        raise SimulationError("vary: seed needs one whole number per lane")
    return seeds.astype(np.int64)


def varied(loop: dict[str, Any], values: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return the loop with lanes in the leaves that vary, checked as a whole.

    Parameters
    ----------
    loop
        Machine, controller, disturbances by name.
    values
        As ``lane_values`` returned them; ``seed`` is passed over.

    Raises
    ------
    SimulationError
        A path that begins with no part of the loop, or names no number; two paths to one number.
    ConfigurationError
        A path that names nothing, or a value out of bounds.
    """
    batch = dict(loop)
    written: dict[str, str] = {}
    for path, value in values.items():
        if path == "seed":
            continue
        head = path.partition(".")[0]
        if head not in loop:
            raise SimulationError(f"vary: {choices(head, [*loop, 'seed'])}, got {path!r}")
        full = resolve(loop, path)
        if full in written:
            raise SimulationError(f"vary: {written[full]} and {path} are the same, {full}")
        written[full] = path
        batch = replace_at(batch, full, _like(loop, full, value.astype(float)))
    return batch


def mapped_axes(single: Any, batch: Any) -> HashableTree:
    """Return the ``in_axes`` of a batch: 0 for leaves with lanes, None for the others.

    Parameters
    ----------
    single, batch
        The loop before and after ``varied``.
    """

    def axis(one: Any, many: Any) -> int | None:
        return 0 if np.ndim(many) > np.ndim(one) else None

    return HashableTree.of(jax.tree.map(axis, single, batch))


def _like(loop: Any, path: str, value: NDArray[Any]) -> NDArray[Any]:
    """Return lane values in the shape of the field that they replace."""
    field, bounds = loop, {}
    for name in path.split("."):
        if isinstance(field, Mapping):
            field = field[name]
        elif isinstance(field, tuple):
            field = field[int(name)]
        else:
            bounds = field.__dataclass_fields__[name].metadata.get("real", {})
            field = getattr(field, name)
    if not isinstance(field, jax.Array | np.ndarray):
        raise SimulationError(f"vary: {path} is not a number that can be varied in a batch")
    if np.ndim(field) == 0:
        # one number for all axes may become one per axis; one per lane must not look like that
        per_axis = bounds.get("ndim") == 1 and value.ndim == 1
        return value[:, None] if per_axis else value
    shape = (len(value), *np.shape(field))
    while value.ndim < len(shape):
        value = value[..., None]
    try:
        return np.ascontiguousarray(np.broadcast_to(value, shape))
    except ValueError:
        raise SimulationError(
            f"vary: {path} needs lanes of shape {shape[1:]} or single numbers, "
            f"got {value.shape[1:]}"
        ) from None
