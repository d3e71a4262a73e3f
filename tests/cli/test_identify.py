"""``contourlab identify``: from a log to a machine that ``compare`` takes, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples" / "logs"
LOG = EXAMPLES / "simulated_stage.csv"
COLUMNS = ("--actual", "X_actual,Y_actual", "--commanded", "X_set,Y_set", "--command",
           "X_force,Y_force")  # fmt: skip


@pytest.fixture
def program(in_process):
    return lambda *arguments: in_process(*map(str, arguments))


def test_a_log_becomes_a_machine_that_compare_takes(program, tmp_path):
    machine, page, motion = (tmp_path / n for n in ("machine.toml", "page.html", "motion.csv"))
    status, out, _ = program(
        "identify", LOG, "--output", machine, "--report", page, "--suggest", motion, "--json",
    )  # fmt: skip
    assert status == 0
    body = json.loads(out)
    # columns are found by their names and units, the command too, and that is said
    assert any("command is taken from X_force" in warning for warning in body["warnings"])
    assert body["schema"] == "contourlab.identify/1"
    for axis, name, mass in zip(body["axes"], "XY", (6.2, 3.4), strict=True):
        assert axis["axis"] == name
        one = axis["parameters"]["mass"]
        assert set(one) == {"value", "low", "high", "unit"}
        assert one["unit"] == "kg"
        assert one["value"] == pytest.approx(mass, rel=1e-4)
    assert body["machine"] == str(machine)
    text = page.read_text()
    assert "Content-Security-Policy" in text
    assert "6.2000" in text
    assert "http" not in text.split("<script>", 2)[0].replace("http-equiv", "")
    rows = np.loadtxt(motion, delimiter=",", skiprows=1)
    assert rows.shape[1] == 3
    scenario = tmp_path / "identified.toml"
    scenario.write_text((EXAMPLES / "identified.toml").read_text())
    status, out, err = program("compare", scenario, "--json")
    assert status == 0, err
    assert len(json.loads(out)["runs"]) == 2
    status, _, err = program("identify", LOG, *COLUMNS, "--output", machine)
    assert status == 2
    assert "exists already" in err


def test_a_log_of_positions_alone_tells_how_the_loop_follows(program, tmp_path):
    page = tmp_path / "page.html"
    status, out, err = program(
        "identify", LOG, "--kind", "position", "--window", "1 s,2.5 s", "--json", "--report", page,
    )  # fmt: skip
    assert status == 0, err
    body = json.loads(out)
    for axis in body["axes"]:
        one = axis["parameters"]["velocity_lag"]
        assert one["unit"] == "s"
        # the law of the example feeds all of its motion forward: what is left is its delay
        assert abs(one["value"]) < 2e-3
    text = " ".join(body["warnings"])
    assert "the command is taken" not in text
    assert "only the velocity lag is told" in text
    assert "Mass and friction in N need a column" in page.read_text()


def test_mistakes_are_named(program, tmp_path):
    still = tmp_path / "still.csv"
    rows = np.column_stack([np.arange(400) * 1e-3, np.zeros((400, 2))])
    np.savetxt(still, rows, delimiter=",", header="time [s],X [mm],u [N]", comments="")
    one = tmp_path / "one.csv"
    one.write_text("time [s],X [mm],u [N]\n0,1,2\n")
    back = tmp_path / "back.csv"
    rows[:, 1] = np.sin(rows[:, 0] * 40)
    rows[200:, 0] -= 0.1
    np.savetxt(back, rows, delimiter=",", header="time [s],X [mm],u [N]", comments="")
    columns = ("--actual", "X", "--command", "u", "--axes", "X")
    for arguments, text in (
        ((LOG, "--actual", "X_nowhere,Y_actual", *COLUMNS[2:]), "X_nowhere"),
        ((LOG, *COLUMNS, "--kind", "thrust"), "unknown kind 'thrust'"),
        ((LOG, *COLUMNS, "--spring", "perhaps"), "spring must be auto, yes or no"),
        ((LOG, *COLUMNS, "--known", "mass"), "known must be name=value"),
        ((LOG, *COLUMNS, "--window", "2 s"), "window must be a start and an end"),
        ((LOG, *COLUMNS, "--confidence", "2"), "confidence must be"),
        ((LOG, "--kind", "position", "--track", "1 s", "--spring", "no"), "one log of positions"),
        ((LOG, LOG, "--kind", "position", "--drive-lag"), "one log of positions"),
        ((LOG, *COLUMNS, "--track", "1 s", "--false-alarms", "1e-5"), "rate must be >= 0.0005"),
        ((still, *columns), "constant"),
        ((one, *columns), "one.csv"),
        ((back, *columns), "back.csv"),
        ((tmp_path / "gone.csv", *columns), "gone.csv"),
    ):
        status, out, err = program("identify", *arguments)
        assert (status, out) == (2, ""), (arguments, err)
        assert text in err


def test_several_logs_are_tracked(program, tmp_path):
    """Two of them too: the first is then what the second is compared with."""
    later = tmp_path / LOG.name
    later.write_bytes(LOG.read_bytes())
    status, out, err = program("identify", LOG, later, *COLUMNS, "--json")
    assert status == 0, err
    health = json.loads(out)["health"]
    assert health["changes"] == []
    # of one name, told apart by their folders
    assert health["records"] == [f"{LOG.parent.name}/{LOG.name}", f"{tmp_path.name}/{LOG.name}"]
    assert health["baseline_records"] == 1
