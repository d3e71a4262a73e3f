"""What JAX compiled, kept between runs of the program."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

__all__ = ["keep_compiled"]


def keep_compiled() -> None:
    """Let JAX keep what it compiled in the user's cache folder, between runs."""
    import jax

    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    folder = Path(home) / "contourlab" / "jax"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return  # a home that cannot be written to costs compile time, nothing else
    update: Any = jax.config.update
    update("jax_compilation_cache_dir", str(folder))
    update("jax_persistent_cache_min_compile_time_secs", 0.05)
    update("jax_persistent_cache_min_entry_size_bytes", -1)
