"""Machine parameters from recordings, with their uncertainty."""

from contourlab.identification.even import even_recording
from contourlab.identification.exciting_motion import ExcitingMotion, exciting_motion
from contourlab.identification.frequency_model import FrequencyModel, fit_frequency_response
from contourlab.identification.frequency_response import (
    FrequencyResponse,
    frequency_response,
    is_sweep,
)
from contourlab.identification.health import Change, Health, HealthSeries, track_health
from contourlab.identification.identify import INSTRUMENTS, identify
from contourlab.identification.machine import identify_machine
from contourlab.identification.machine_model import identified_machine
from contourlab.identification.machine_result import AxisModel, MachineIdentification
from contourlab.identification.position_loop import identify_position_loops
from contourlab.identification.result import (
    AxisIdentification,
    Identification,
    Parameter,
)
from contourlab.identification.trend import Trend, estimate_trend

__all__ = [
    "INSTRUMENTS",
    "AxisIdentification",
    "AxisModel",
    "Change",
    "ExcitingMotion",
    "FrequencyModel",
    "FrequencyResponse",
    "Health",
    "HealthSeries",
    "Identification",
    "MachineIdentification",
    "Parameter",
    "Trend",
    "estimate_trend",
    "even_recording",
    "exciting_motion",
    "fit_frequency_response",
    "frequency_response",
    "identified_machine",
    "identify",
    "identify_machine",
    "identify_position_loops",
    "is_sweep",
    "track_health",
]
