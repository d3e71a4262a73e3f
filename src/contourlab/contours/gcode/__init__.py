"""G-code: RS-274 programs as LinuxCNC speaks them."""

from contourlab.contours.gcode.interpreter import Interpretation, Interpreter
from contourlab.contours.gcode.reader import read_gcode, read_gcode_text

__all__ = ["Interpretation", "Interpreter", "read_gcode", "read_gcode_text"]
