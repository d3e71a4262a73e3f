"""A command that is interrupted while it works."""

import signal
import subprocess
import sys
import time
from pathlib import Path


def interrupted(folder, *arguments):
    """Return the exit status and the error text of a command interrupted once it has loaded JAX."""
    process = subprocess.Popen(
        [sys.executable, "-m", "contourlab", *arguments],
        cwd=folder, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        # a shell that runs the tests in the background has them ignore the signal
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    own = Path(f"/proc/{process.pid}")
    for _ in range(600):  # until the command, no longer a copy of this process, has loaded JAX
        if not own.exists():
            break
        started = arguments[0].encode() in (own / "cmdline").read_bytes()
        if started and "jaxlib" in (own / "maps").read_text():
            break
        time.sleep(0.1)
    time.sleep(0.5)
    errors = ""
    for _ in range(100):  # one that falls into a destructor is lost, as for a user
        process.send_signal(signal.SIGINT)
        try:
            _, errors = process.communicate(timeout=5.0)
            break
        except subprocess.TimeoutExpired:
            continue
    return process.returncode, errors
