"""Shared by all tests: float64, compiling that costs less, and a folder for compiled code."""

import gc
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import jax
import pytest

import contourlab  # noqa: F401  (float64)

_HOME = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
_CACHE = _HOME / "contourlab" / "jax-tests"

_QUICK = (
    "--xla_cpu_use_fusion_emitters=false"
    " --xla_backend_optimization_level=0"
    " --xla_cpu_parallel_codegen_split_count=1"
)
"""XLA's older way to write loops, LLVM without its passes, in one part: most programs of tests run
for less time than they compile."""


def _compile_quickly() -> None:
    """Compile in half the time; slow tests, and tests started by hand, run as users run."""
    flags = " ".join(filter(None, [os.environ.get("XLA_FLAGS"), _QUICK]))
    # an XLA that does not know a flag ends the process
    known = subprocess.run(
        [sys.executable, "-c", "import jax; jax.numpy.zeros(1)"],
        env={**os.environ, "XLA_FLAGS": flags},
        capture_output=True,
    )
    if known.returncode == 0:
        os.environ["XLA_FLAGS"] = flags


def pytest_configure(config: pytest.Config) -> None:
    jax.config.update("jax_compilation_cache_dir", str(_CACHE))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    # tracing makes millions of small objects, few of them in cycles
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)
    # for examples, snippets and programs that tests start
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(_CACHE)
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
    # workers and programs inherit the environment
    if not hasattr(config, "workerinput") and "not slow" in config.option.markexpr:
        _compile_quickly()


_MOST = 3 << 30
"""Bytes of memory a process of tests may hold before it lets go of what it compiled."""


@pytest.fixture(autouse=True, scope="module")
def _compiled_code_is_let_go() -> Iterator[None]:
    """Executables pile up over thousands of tests; they come back from the folder."""
    yield
    statm = Path("/proc/self/statm")
    if statm.exists() and int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") > _MOST:
        jax.clear_caches()
        gc.collect()
