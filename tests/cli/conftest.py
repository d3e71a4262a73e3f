"""The program in this process: what it decides costs no start of Python."""

import signal
import sys

import pytest

from contourlab.cli import main as program


@pytest.fixture
def in_process(tmp_path, monkeypatch, capsys):
    """Run the program in this process, in an empty folder; its compile cache stays as it is."""
    # the program leaves interrupts ignored, which the test run must not
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.chdir(tmp_path)
    for name, module in list(sys.modules.items()):
        if name.startswith("contourlab.cli.") and hasattr(module, "keep_compiled"):
            monkeypatch.setattr(module, "keep_compiled", lambda: None)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["contourlab", *arguments])
        with pytest.raises(SystemExit) as stopped:
            program()
        return stopped.value.code or 0, *capsys.readouterr()

    return run
