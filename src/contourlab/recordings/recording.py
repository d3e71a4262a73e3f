"""What happened, sample by sample: the end of a simulation and of a measured log alike."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import RecordingError, choices
from contourlab.recordings.metrics import METRICS, MetricValue, evaluate_metric

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from contourlab.contours.base import Contour

__all__ = ["Metrics", "Recording"]


class Metrics(Mapping[str, MetricValue]):
    """The figures of merit of a recording, computed when asked for.

    Holds every metric that the recording has the data for; asking for another says what is missing.
    """

    def __init__(self, recording: Recording, window: tuple[float, float] | None = None) -> None:
        self._recording, self._window = recording, window

    def __getitem__(self, name: str) -> MetricValue:
        if name not in METRICS:
            raise RecordingError(f"no metric {name!r}; {choices(name, METRICS)}")
        return evaluate_metric(self._recording.dataset, name, self._window)

    def __iter__(self) -> Iterator[str]:
        held = set(self._recording.dataset.variables)
        return (name for name, metric in METRICS.items() if metric.requires <= held)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __repr__(self) -> str:
        return f"Metrics({dict(self)!r})"


class Recording:
    """A record of a run, over an ``xarray.Dataset``.

    Variables, on the dimensions ``time`` [s], ``axis`` and ``coordinate`` (of the tool point):
    ``reference``, ``actual``, ``measured``, ``tracking_error`` (time, axis) [m]; ``command``
    (time, axis); ``contour_error`` (time) [m], signed in the plane and a norm otherwise;
    ``contour_error_vector``, ``tool`` (time, coordinate) [m]; ``reference_parameter`` and
    ``foot_parameter`` (time); ``status`` (time); telemetry under its own names. A measured log
    holds those that were measured.

    Parameters
    ----------
    dataset
        The variables, with units and provenance in attributes.
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self.dataset = dataset

    def __getitem__(self, name: str) -> xr.DataArray:
        if name not in self.dataset.variables:
            raise RecordingError(
                f"the recording holds no {name!r}; "
                + choices(name, [str(key) for key in self.dataset.variables])
            )
        return self.dataset[name]

    def __repr__(self) -> str:
        controller = self.dataset.attrs.get("controller", "log")
        return f"<Recording {controller}: {self.n_samples} samples, {self.status}>"

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self.dataset.sizes["time"])

    @property
    def metrics(self) -> Metrics:
        """Figures of merit over the whole record, start transient included."""
        return Metrics(self)

    def metrics_between(self, start: float, end: float) -> Metrics:
        """Return figures of merit over a window of time.

        Parameters
        ----------
        start, end
            Times [s], both included.

        Raises
        ------
        RecordingError
            The window holds no sample.
        """
        time = np.asarray(self.dataset["time"])
        if not ((time >= start) & (time <= end)).any():
            raise RecordingError(
                f"no sample between {start:g} s and {end:g} s; "
                f"the record runs from {time[0]:g} s to {time[-1]:g} s"
            )
        return Metrics(self, (start, end))

    def global_contour_error(self, contour: Contour) -> NDArray[Any]:
        """Return the contour error against the whole contour, shape (n_samples,) [m].

        The recording's own ``contour_error`` is the local one: against the stretch around the
        reference, which is what a controller is to blame for. Where a contour comes near itself the
        global one can be smaller, never larger.

        Parameters
        ----------
        contour
            The path that the run followed.

        Raises
        ------
        RecordingError
            The recording holds no tool positions.
        """
        from contourlab.contours.foot_points import foot_point

        return np.asarray(foot_point(contour, np.asarray(self["tool"])).distance)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know: limits that were violated, fall-backs taken, divergence."""
        return tuple(json.loads(self.dataset.attrs.get("warnings", "[]")))

    @property
    def status(self) -> str:
        """``normal``, or in a few words what went wrong."""
        return str(self.dataset.attrs.get("outcome", "normal"))

    @property
    def diverged(self) -> bool:
        """Whether the run was stopped because it diverged."""
        return "diverged_at" in self.dataset.attrs

    def save(self, file: str | FilePath, *, force: bool = False) -> None:
        """Write the recording as netCDF-4, atomically.

        Parameters
        ----------
        file
            Where, usually ``.nc``.
        force
            Whether an existing file may be replaced.

        Raises
        ------
        OutputError
            The file exists already.
        """
        from contourlab.recordings.files import atomic_file

        with atomic_file(file, force=force) as temporary:
            self.dataset.to_netcdf(temporary, engine="h5netcdf")

    @staticmethod
    def load(file: str | FilePath) -> Recording:
        """Return a recording from netCDF.

        Parameters
        ----------
        file
            As ``save`` wrote it.

        Raises
        ------
        RecordingError
            There is no such file, or it is not a recording.
        """
        import xarray as xr

        if not FilePath(file).is_file():
            raise RecordingError(f"{file}: there is no such file")
        try:
            dataset = xr.load_dataset(file, engine="h5netcdf")
        except (OSError, ValueError, KeyError) as error:
            raise RecordingError(f"{file}: not a recording in netCDF-4 ({error})") from error
        if "time" not in dataset.dims:
            raise RecordingError(f"{file}: not a recording: it has no dimension time")
        return Recording(dataset)

    def to_pandas(self) -> pd.DataFrame:
        """Return a table over time [s], one column per variable and axis, such as ``actual_X``."""
        import pandas as pd

        columns: dict[str, Any] = {}
        for name, variable in self.dataset.data_vars.items():
            if variable.dims == ("time",):
                columns[str(name)] = np.asarray(variable)
            elif len(variable.dims) == 2 and variable.dims[0] == "time":
                for label in np.asarray(variable[variable.dims[1]]):
                    columns[f"{name}_{label}"] = np.asarray(variable.sel({variable.dims[1]: label}))
        return pd.DataFrame(columns, index=pd.Index(np.asarray(self.dataset["time"]), name="time"))

    def to_csv(self, file: str | FilePath, *, force: bool = False) -> None:
        """Write ``to_pandas`` as CSV, atomically; SI units, 17 significant digits.

        Parameters
        ----------
        file
            Where.
        force
            Whether an existing file may be replaced.

        Raises
        ------
        OutputError
            The file exists already.
        """
        from contourlab.recordings.files import atomic_file

        with atomic_file(file, force=force) as temporary:
            self.to_pandas().to_csv(temporary, float_format="%.17g")
