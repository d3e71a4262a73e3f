"""The program in this process: what it decides costs no start of Python."""

import signal
import sys

import pytest

from contourlab.cli import main as program


@pytest.fixture
def in_process(tmp_path, monkeypatch, capsys):
    """Run the program in this process, in an empty folder."""
    # the program leaves interrupts ignored, which the test run must not
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["contourlab", *arguments])
        with pytest.raises(SystemExit) as stopped:
            program()
        return stopped.value.code or 0, *capsys.readouterr()

    return run
