"""Scenario files: TOML, validated, turned into objects."""

from contourlab.scenarios.reader import Scenario, read_scenario, read_scenario_text

__all__ = ["Scenario", "read_scenario", "read_scenario_text"]
