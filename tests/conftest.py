"""Shared by all tests: float64, and a folder for compiled code between runs."""

import gc
import os
from collections.abc import Iterator
from pathlib import Path

import jax
import pytest

import contourlab  # noqa: F401  (float64)

_HOME = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
_CACHE = _HOME / "contourlab" / "jax-tests"


def pytest_configure(config: pytest.Config) -> None:
    jax.config.update("jax_compilation_cache_dir", str(_CACHE))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    # for examples, snippets and programs that tests start
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(_CACHE)
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"


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
