"""What is read of a recording, and what is refused."""

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from contourlab import Recording
from contourlab.errors import RecordingError
from contourlab.identification import identify
from contourlab.identification.record import read_record

from .loops import T, recording

COMMAND = np.stack([np.arange(20.0), -np.arange(20.0)], axis=1)
POSITION = np.cumsum(COMMAND, axis=0) * 1e-4


def changed(**variables):
    record = recording(POSITION, COMMAND, POSITION)
    return Recording(record.dataset.assign(variables))


def test_a_delay_moves_the_command_by_samples_and_parts_of_samples():
    record = recording(POSITION, COMMAND)
    assert_allclose(read_record(record).acting, COMMAND)
    whole = read_record(record, computing_delay=2 * T)
    assert_allclose(whole.acting[2:], COMMAND[:-2])
    part = read_record(record, computing_delay=1.25 * T)
    # the first quarter of a period is still the command before
    assert_allclose(part.acting[2:, 0], 0.25 * np.arange(18) + 0.75 * np.arange(1, 19))
    assert part.waiting == 2


def test_a_window_and_the_limit_of_the_command():
    limited = changed(command_limit=("axis", [5.0, 1e9]))
    read = read_record(limited, window=(0.0049, 0.0121), computing_delay=T)
    assert_allclose(read.time, T * np.arange(5, 13))
    assert_allclose(read.acting[:, 0], np.minimum(np.arange(4, 12), 5.0))
    assert_allclose(read.acting[:, 1], -np.arange(4.0, 12.0))
    assert_allclose(read.limit, [5.0, 1e9])
    assert read.waiting == 0  # the command before the window is known
    assert read.names == ("X", "Y")


@pytest.mark.parametrize(
    ("record", "message"),
    [
        (
            changed(time=np.where(np.arange(20) == 7, 7.3e-3, T * np.arange(20))),
            "samples must be equidistant",
        ),
        (changed(measured=(("time", "axis"), np.full((20, 2), np.nan))), "measured is not finite"),
        (recording(POSITION, COMMAND, kind=None), "give command_kind"),
        (recording(POSITION, COMMAND, kind="position"), "no mass and friction .* position command"),
        (Recording(changed().dataset.drop_vars("command")), "holds no 'command'"),
        (
            Recording(changed().dataset.assign_attrs(diverged_at=1.0, outcome="diverged at 1 s")),
            "the run diverged at 1 s",
        ),
        (
            Recording(xr.Dataset({"measured": ("time", [0.0] * 9), "command": ("time", [0.0] * 9)},
                                 coords={"time": T * np.arange(9)})),
            "one value per sample and axis",
        ),
    ],
)  # fmt: skip
def test_unfit_recordings_are_refused(record, message):
    with pytest.raises(RecordingError, match=message):
        read_record(record)


def test_without_a_reference_another_instrument_is_asked_for():
    with pytest.raises(RecordingError, match="choose instrument='delayed'"):
        identify(recording(POSITION, COMMAND))
    assert read_record(recording(POSITION, COMMAND), command_kind="voltage").kind == "voltage"
