"""Measured logs: read from whatever a controller or an instrument wrote."""

from contourlab.logs.log import ColumnUse, Log
from contourlab.logs.read import open_log, read_log
from contourlab.logs.source import Source

__all__ = ["ColumnUse", "Log", "Source", "open_log", "read_log"]
