"""What JAX compiled, kept between runs of the program."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

__all__ = ["keep_compiled"]


def keep_compiled() -> None:
    """Let JAX keep what it compiled in the user's cache folder, between runs.

    A folder that was chosen already, by ``JAX_COMPILATION_CACHE_DIR`` or by the program that calls
    this one, is kept, and what goes into it too.
    """
    import jax

    config: Any = jax.config
    if config.jax_compilation_cache_dir is not None:
        return
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    folder = Path(home) / "contourlab" / "jax"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return  # a home that cannot be written to costs compile time, nothing else
    config.update("jax_compilation_cache_dir", str(folder))
    config.update("jax_persistent_cache_min_compile_time_secs", 0.05)
    config.update("jax_persistent_cache_min_entry_size_bytes", -1)
