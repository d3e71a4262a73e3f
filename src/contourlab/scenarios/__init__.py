"""Scenario files: TOML, validated, turned into objects."""

from contourlab.scenarios.machine_file import read_machine_file, write_machine_file
from contourlab.scenarios.machine_text import machine_to_toml
from contourlab.scenarios.reader import read_scenario, read_scenario_text
from contourlab.scenarios.scenario import Scenario, Setup

__all__ = [
    "Scenario",
    "Setup",
    "machine_to_toml",
    "read_machine_file",
    "read_scenario",
    "read_scenario_text",
    "write_machine_file",
]
