"""The command line: a thin face of the public functions, under the same names."""

from contourlab.cli.main import main

__all__ = ["main"]
