"""What a batch is judged by: metrics with the exact contour error, chunk by chunk."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.foot_points import foot_point

__all__ = ["ESTIMATE", "EXACT", "Judged"]

EXACT = frozenset({"contour_error_rms", "contour_error_max", "contour_error_mean"})
ESTIMATE = frozenset({"estimate_error_rms", "estimate_error_max"})


class Judged:
    """Sums and maxima, over lanes, of what is judged by the exact contour error.

    Parameters
    ----------
    contour
        The path.
    wanted
        Names of metrics; those that are not in :data:`EXACT` or :data:`ESTIMATE` are passed over.
    lanes
        How many.
    """

    def __init__(self, contour: Contour, wanted: tuple[str, ...], lanes: int) -> None:
        self.contour = contour
        self.names = tuple(name for name in wanted if name in EXACT | ESTIMATE)
        self.sums = {name: np.zeros(lanes) for name in self.names if not name.endswith("_max")}
        self.maxima = {name: np.zeros(lanes) for name in self.names if name.endswith("_max")}

    def add(
        self, rows: Mapping[str, NDArray[Any]], valid: NDArray[Any], parameter: NDArray[Any]
    ) -> NDArray[Any]:
        """Take in a chunk and return its contour error vectors, NaN where a lane is lost.

        Parameters
        ----------
        rows
            ``tool`` and, if asked for, ``contour_error_estimate``, (lanes, steps, coordinates) [m];
            of a law that plans its own time ``path_parameter``, (lanes, steps).
        valid
            Which of them count, (lanes, steps).
        parameter
            Of the reference, (steps,).
        """
        tool = rows["tool"]
        near = rows.get("path_parameter", np.broadcast_to(parameter, valid.shape))
        if valid.all():
            points = tool.reshape(-1, tool.shape[-1])
            feet = foot_point(self.contour, points, near=near.reshape(-1))
            vector: NDArray[Any] = np.asarray(feet.vector).reshape(tool.shape)
        else:
            vector = np.full(tool.shape, np.nan)
            vector[valid] = foot_point(self.contour, tool[valid], near=near[valid]).vector
        sizes = {"contour_error": vector}
        if "contour_error_estimate" in rows:
            sizes["estimate_error"] = rows["contour_error_estimate"] - vector
        for what in dict.fromkeys(name.rsplit("_", 1)[0] for name in self.names):
            squared = np.einsum("lsk,lsk->ls", sizes[what], sizes[what])
            squared[~valid] = 0.0
            for name in self.names:
                if name == f"{what}_max":
                    largest = np.sqrt(squared.max(axis=1))
                    self.maxima[name] = np.maximum(self.maxima[name], largest)
                elif name == f"{what}_rms":
                    self.sums[name] += squared.sum(axis=1)
                elif name == f"{what}_mean":
                    self.sums[name] += np.sqrt(squared).sum(axis=1)
        return vector
