"""The files of a LinuxCNC component: what is in them, and what is refused."""

import re
import shutil
import subprocess

import pytest

from contourlab.errors import ConfigurationError, RefusedError
from contourlab.export.linuxcnc import LICENCES, LinuxcncOptions, linuxcnc_files

from .probe_law import facts, probe

GPL = LinuxcncOptions(license="GPL")


def test_the_files(tmp_path):
    files = linuxcnc_files(probe(), facts(), GPL)
    assert set(files) == {
        "probe.h",
        "probe.c",
        "probe_servo.h",
        "probe_servo.c",
        "probe_component.h",
        "probe.comp",
        "probe.hal",
        "Makefile",
        "README.md",
    }
    for text in files.values():
        assert text.endswith("\n")
        assert not text.endswith("\n\n")


@pytest.mark.parametrize("given", [None, "MIT", "proprietary", "gpl"])
def test_a_licence_is_asked_for(given):
    with pytest.raises(RefusedError, match=r"compatible with the GPL.*--license") as refusal:
        LinuxcncOptions(license=given)
    assert all(name in str(refusal.value) for name in LICENCES)


@pytest.mark.parametrize("name", LICENCES)
def test_the_component_states_its_licence(name):
    files = linuxcnc_files(probe(), facts(), LinuxcncOptions(license=name))
    assert f'license "{name}";' in files["probe.comp"]
    assert name in files["README.md"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"length_unit": "furlong"}, "length_unit"),
        ({"following_error_limit": 0.0}, "following_error_limit must be > 0"),
        ({"following_error_limit": float("nan")}, "following_error_limit must be > 0"),
        ({"hold_speed": -1.0}, "hold_speed must be > 0"),
        ({"minimum_radius": float("inf")}, "minimum_radius must be > 0"),
    ],
)
def test_options_out_of_bounds(options, says):
    with pytest.raises(ConfigurationError, match=says):
        LinuxcncOptions(license="GPL", **options)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"joints": (0,)}, "joints must be 2 different numbers"),
        ({"joints": (1, 1)}, "joints must be 2 different numbers"),
        ({"joints": (0, -1)}, "joints must be 2 different numbers"),
        ({"command_limit": 0.0}, "command_limit must be > 0 N"),
        ({"command_limit": (1.0, 2.0, 3.0)}, "command_limit must be > 0 N"),
    ],
)
def test_options_that_do_not_fit_the_law(options, says):
    with pytest.raises(ConfigurationError, match=says):
        linuxcnc_files(probe(), facts(), LinuxcncOptions(license="GPL", **options))


@pytest.mark.parametrize("prefix", ["Probe", "pro__be", "probe_", "1probe", "p" * 21])
def test_a_prefix_that_hal_cannot_take(prefix):
    with pytest.raises(ConfigurationError, match="prefix must be"):
        linuxcnc_files(probe(prefix=prefix), facts(), GPL)


def test_a_law_without_a_limit_is_refused():
    with pytest.raises(RefusedError, match="has no command limit"):
        linuxcnc_files(probe(), facts(limit=float("inf")), GPL)
    given = LinuxcncOptions(license="GPL", command_limit=(7.0, 8.0))
    assert (
        "setp probe.command-limit-1 8.0"
        in (linuxcnc_files(probe(), facts(limit=float("inf")), given)["probe.hal"])
    )


def test_a_law_that_plans_its_own_time_is_refused():
    with pytest.raises(RefusedError, match="plans its own time"):
        linuxcnc_files(probe(), facts(own_time=True), GPL)


def test_a_law_that_evaluates_its_contour_is_refused():
    with pytest.raises(RefusedError, match="would pull towards it during approaches"):
        linuxcnc_files(probe(), facts(contour=True), GPL)


def test_a_path_in_other_coordinates_than_the_axes_is_refused():
    with pytest.raises(RefusedError, match="3 coordinates on 2 axes"):
        linuxcnc_files(probe(3), facts(2), GPL)


def test_the_files_say_what_the_machine_must_be():
    files = linuxcnc_files(
        probe(preview=5), facts(preview=5),
        LinuxcncOptions(license="GPL", joints=(2, 0), length_unit="inch"),
    )  # fmt: skip
    assert "SERVO_PERIOD = 1000000" in files["probe.hal"]
    assert "joint.2.motor-pos-cmd => probe.reference-position-0" in files["probe.hal"]
    assert "joint.0.motor-pos-cmd => probe.reference-position-1" in files["probe.hal"]
    assert "=> joint.2.amp-fault-in => joint.0.amp-fault-in" in files["probe.hal"]
    assert "5 servo cycles (5 ms) late" in files["README.md"]
    assert f"{0.0254:.17g}" in files["probe_servo.c"]


def test_every_line_of_hal_is_known():
    """What begins no comment is a command of halcmd, on pins that the component has."""
    files = linuxcnc_files(probe(), facts(), GPL)
    pins = {
        re.sub(r"[-_]*#", "", name).replace("_", "-")
        for name in re.findall(r"^(?:pin|param) \w+ \w+ ([\w.#]+)", files["probe.comp"], re.M)
    }
    for line in files["probe.hal"].splitlines():
        if not line or line.startswith("#"):
            continue
        assert line.split()[0] in ("loadrt", "addf", "net", "setp")
        for pin in re.findall(r"probe\.([\w.-]+)", line):
            assert re.sub(r"-\d+$", "", pin) in pins | {"cycle"}


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
@pytest.mark.parametrize("options", [{}, {"preview": 4}, {"precision": "single"}])
def test_no_warning_of_the_compiler(options, tmp_path):
    preview = options.get("preview", 0)
    for kind in ("force", "velocity", "position"):
        given = facts(command=kind, preview=preview)
        for name, text in linuxcnc_files(probe(**options), given, GPL).items():
            (tmp_path / name).write_text(text)
        strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only"]
        subprocess.run(["gcc", *strict, "probe_servo.c"], check=True, cwd=tmp_path)


def test_long_names_are_shortened_and_told_apart():
    import dataclasses

    from contourlab.export.fields import Field
    from contourlab.export.hal_items import gain_items

    names = (
        "axis_feed_forward_friction_velocity_of_the_third_kind",
        "axis_feed_forward_friction_velocity",
        "x" * 60,
        "kp",
        "kp_0",
    )
    parameters = tuple(
        Field(name, () if name == "kp_0" else (2,), "", "real", name) for name in names
    )
    made = dataclasses.replace(probe(prefix="p" * 20), parameters=parameters)
    items, hidden = gain_items(made)
    assert hidden == []
    shown = [f"{'p' * 20}.{item.shown.replace('N', '1' if item.array else '')}" for item in items]
    assert max(map(len, shown)) <= 47
    taken = [name for item in items for name in _numbered(item)]
    assert len(set(taken)) == len(taken)


def _numbered(item):
    count = item.field.size if item.array else 1
    return [item.shown.replace("N", str(k)) for k in range(count)]


def test_names_that_are_too_long_for_hal_are_shortened_alike():
    from contourlab.export.fields import Field
    from contourlab.export.hal_items import HAL_NAME_LENGTH, _hal_names

    def names(prefix, group, *fields):
        return _hal_names(prefix, group, [Field(one, (2,), "", "real", one) for one in fields])

    assert names("c", "law", "feed_forward_friction") == ["law.feed_forward_friction_#"]
    both = "axis_feed_forward_friction_velocity", "axis_feed_forward_velocity"
    found = names("cross_coupled", "law", *both)
    assert found == ["law.axis_ff_friction_velocity_#", "law.axis_ff_velocity_#"]
    assert names("cross_coupled", "telemetry", "contour_error_estimate") == [
        "telemetry.contour_error_est_#"
    ]
    for name in found:
        assert len("cross_coupled." + name) <= HAL_NAME_LENGTH
