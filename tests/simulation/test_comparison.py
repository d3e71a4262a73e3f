"""Several controllers on the same part."""

import dataclasses

import pytest

import contourlab as cl
from contourlab.controllers.base import Needs
from contourlab.errors import ConfigurationError, RefusedError, SimulationError
from contourlab.simulation.jax_engine import JaxEngine

from .loops import BoundProportional, Proportional, line_reference, velocity_stage


def test_names_order_and_best():
    slow, fast = Proportional(k=20.0), Proportional(k=60.0)
    result = cl.compare(velocity_stage((0.01, 0.02)), [slow, fast], line_reference(n=800))
    assert result.names == ("proportional_1", "proportional_2")
    assert result.best("tracking_error_rms") == "proportional_2"
    table = result.table()
    assert list(table.index) == list(result.names)
    assert {"contour_error_rms", "command_max_X", "command_max_Y", "status"} <= set(table.columns)


def test_one_diverging_run_does_not_stop_the_others():
    result = cl.compare(
        velocity_stage(), {"wild": Proportional(k=5000.0), "good": Proportional(k=30.0)},
        line_reference(n=3000),
    )  # fmt: skip
    assert result.recordings["wild"].diverged
    assert result.best("contour_error_rms") == "good"


class Failing(JaxEngine):
    """Cannot compute the law whose gain is 7."""

    def run(self, loop, told):
        if float(loop.law.law.k) == 7.0:
            raise self.kind("no such operation")
        return super().run(loop, told)


class Wrong(Proportional):
    """Has a value that is wrong on every machine, which binding sees."""

    def bind(self, contour, sample_time):
        raise ConfigurationError("k must be < 1 1/s, got 1")


def test_a_law_that_does_not_fit_or_fails_leaves_the_others_their_runs():
    laws = {
        "made for another": RefusedError("is for lathes"), "good": Proportional(k=30.0),
        "three": Proportional(k=1.0, axes=3), "broken": Proportional(k=7.0),
    }  # fmt: skip
    engine = Failing()
    engine.kind = SimulationError
    result = cl.compare(velocity_stage(), laws, line_reference(n=50), engine=engine)
    assert result.names == ("good",)
    assert result.rows == tuple(laws)
    said = [result.status(name) for name in result.rows]
    assert said == [
        "refused: is for lathes", "normal",
        "refused: Proportional commands 3 axes, the machine has 2", "failed: no such operation",
    ]  # fmt: skip
    table = result.table()
    assert list(table["status"]) == said
    assert list(table["contour_error_rms"].isna()) == [True, False, True, True]
    engine.kind = RefusedError  # as an engine says it that does not take a law
    result = cl.compare(velocity_stage(), laws, line_reference(n=50), engine=engine)
    assert result.status("broken") == "refused: no such operation"


def test_mistakes_and_laws_that_are_all_refused_end_before_the_first_runs():
    seen = []

    def ends(laws, message, kind=RefusedError, **more):
        with pytest.raises(kind, match=message):
            cl.compare(
                velocity_stage(), laws, line_reference(n=50), **more,
                progress=lambda name, done: seen.append(name),
            )  # fmt: skip

    three = Proportional(k=1.0, axes=3)
    ends({"a": three, "b": three}, "commands 3 axes")
    ends({"good": Proportional(k=1.0), "bad": Wrong(k=1.0)}, "k must be < 1", ConfigurationError)
    ends({"good": Proportional(k=1.0)}, "seed must be", SimulationError, seed=-1)
    assert seen == []
    engine = Failing()
    engine.kind = SimulationError
    ends({"broken": Proportional(k=7.0)}, "broken failed: no such operation", engine=engine)


class Planned(Proportional):
    """A law that plans its own time, standing still."""

    @property
    def needs(self):
        return Needs(command="velocity", own_time=True)

    def bind(self, contour, sample_time):
        return BoundPlanned(law=self)


class BoundPlanned(BoundProportional):
    def telemetry(self, state):
        return {"path_parameter": 0.0 * state["ahead"][0]}


def test_warnings_of_the_motion_are_for_those_who_follow_it():
    reference = cl.replace(
        line_reference(n=50), warnings=("a word was ignored", "it jumps"),
        motion_warnings=("it jumps",),
    )  # fmt: skip
    laws = {"planned": Planned(k=20.0, stop_at=20), "follows": Proportional(k=20.0)}
    result = cl.compare(velocity_stage(), laws, reference)
    said = {name: recording.warnings for name, recording in result.recordings.items()}
    assert "it jumps" not in said["planned"]
    assert "a word was ignored" in said["planned"]
    assert said["follows"][:2] == reference.warnings
    assert result.reference_warnings == {"": reference.warnings}
    alone = dataclasses.replace(
        result, recordings={"planned": result.recordings["planned"]}, pairs={}
    )
    assert alone.reference_warnings == {"": ("a word was ignored",)}


def test_nothing_to_compare():
    with pytest.raises(SimulationError, match="one controller or more"):
        cl.compare(velocity_stage(), [], line_reference())
