"""Several machines in one comparison."""

import numpy as np
import pytest

import contourlab as cl
from contourlab.errors import RefusedError, SimulationError, TravelError
from contourlab.machines import Drive

from .loops import Proportional, line_reference, velocity_stage

MACHINES = {"quick": velocity_stage((0.005, 0.005)), "slow": velocity_stage((0.02, 0.03))}
LAWS = {"soft": Proportional(k=20.0), "hard": Proportional(k=60.0)}


def test_every_controller_runs_on_every_machine():
    result = cl.compare(MACHINES, LAWS, line_reference())
    assert list(result.runs) == [
        ("quick", "soft"), ("quick", "hard"), ("slow", "soft"), ("slow", "hard"),
    ]  # fmt: skip
    assert result.names[2] == "soft on slow"
    assert result.several
    for (where, name), recording in result.runs.items():
        alone = cl.simulate(MACHINES[where], LAWS[name], line_reference())
        np.testing.assert_array_equal(alone["actual"], recording["actual"])
        assert recording.dataset.attrs["controller"] == name
    assert result.machine_of("hard on slow") is MACHINES["slow"]
    assert result.machine is MACHINES["quick"]
    table = result.table()
    assert (
        table.loc[("slow", "hard"), "contour_error_rms"]
        == result.metric("contour_error_rms")["hard on slow"]
    )


def test_one_named_machine_is_as_one_without_a_name():
    named = cl.compare({"quick": MACHINES["quick"]}, LAWS, line_reference())
    bare = cl.compare(MACHINES["quick"], LAWS, line_reference())
    assert named.names == bare.names == ("soft", "hard")
    assert list(named.runs) == [("quick", "soft"), ("quick", "hard")]
    assert not named.several
    assert list(named.table().index) == ["soft", "hard"]


def test_controllers_of_their_own_machine():
    laws = {"soft": {"quick": LAWS["soft"], "slow": Proportional(k=10.0)},
            "hard": {"slow": LAWS["hard"]}}  # fmt: skip
    result = cl.compare(MACHINES, laws, line_reference())
    assert list(result.runs) == [("quick", "soft"), ("slow", "soft"), ("slow", "hard")]
    alone = cl.simulate(MACHINES["slow"], Proportional(k=10.0), line_reference())
    np.testing.assert_array_equal(alone["actual"], result.recordings["soft on slow"]["actual"])


def test_each_machine_may_have_its_own_motion():
    references = {"quick": line_reference(n=300), "slow": line_reference((0.01, 0.005), n=300)}
    with pytest.raises(SimulationError, match="must follow the same contour"):
        cl.compare(MACHINES, LAWS, references)
    contour = references["quick"].contour
    references["slow"] = cl.replace(line_reference((0.02, 0.01), n=300), contour=contour)
    result = cl.compare(MACHINES, LAWS, references)
    assert result.reference_of("soft on slow") is references["slow"]
    with pytest.raises(SimulationError, match="machine slow has no reference"):
        cl.compare(MACHINES, LAWS, {"quick": references["quick"]})
    with pytest.raises(SimulationError, match="a reference for 'slo'"):
        cl.compare(MACHINES, LAWS, {**references, "slo": references["slow"]})


FORCED = velocity_stage(drive=Drive(command="force"))
SHORT = velocity_stage(travel=[[0.0, 1e-3], [0.0, 1e-3]])


def test_what_does_not_go_together_has_a_row_that_says_so():
    machines = {"forced": FORCED, "quick": MACHINES["quick"], "short": SHORT}
    result = cl.compare(machines, LAWS, line_reference())
    assert result.names == ("soft on quick", "hard on quick")
    assert result.rows[0] == "soft on forced"
    assert result.status("hard on forced").startswith("refused: Proportional gives a velocity")
    assert result.status("hard on short").startswith("refused: the part leaves the travel")
    assert result.pair("hard on short") == ("short", "hard")
    table = result.table()
    assert list(table.index) == [(where, law) for where in machines for law in LAWS]
    assert table["contour_error_rms"].notna().sum() == 2


def test_what_does_not_go_together_is_named_before_anything_runs():
    ran = []

    def refused(machines, laws, message, kind=RefusedError):
        with pytest.raises(kind, match=message):
            cl.compare(machines, laws, line_reference(), progress=lambda *a: ran.append(a))

    refused({"forced": FORCED, "other": FORCED}, LAWS,
            "soft on machine forced: .* gives a velocity command, .* takes a force")  # fmt: skip
    refused({"short": SHORT, "forced": FORCED}, LAWS, "soft on machine short: .*travel",
            TravelError)  # fmt: skip
    refused(MACHINES, {"soft": {"quik": LAWS["soft"]}}, "runs on machine 'quik'; did you mean")
    refused(MACHINES, {"soft": {"quick": LAWS["soft"]}}, "no controller runs on machine slow",
            SimulationError)  # fmt: skip
    refused({}, LAWS, "one machine or more", SimulationError)
    refused(MACHINES, {}, "one controller or more", SimulationError)
    other = velocity_stage(names=("A", "B"))
    refused({**MACHINES, "other": other}, LAWS, "machine other has axes A, B", SimulationError)
    twice = {"b on c": LAWS["soft"], "b": LAWS["hard"]}
    refused({"c": MACHINES["quick"], "c on c": MACHINES["slow"]}, twice,
            "two runs would be called 'b on c on c'", SimulationError)  # fmt: skip
    assert ran == []


def test_variation_is_the_same_on_every_machine():
    result = cl.compare(
        MACHINES, LAWS, line_reference(), vary={"machine.slow.mass": [0.02, 0.05], "seed": [1, 2]}
    )
    assert result.spread["soft on quick"].sample(1) == {}
    assert result.spread["hard on slow"].sample(1) == {"machine.mass": 0.05}
    quick = result.spread["soft on quick"].values("tracking_error_rms")
    assert quick[0] == quick[1]
