"""Where the program keeps what JAX compiled."""

import jax
import pytest

from contourlab.cli.compile_cache import keep_compiled

OPTIONS = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)


@pytest.fixture
def options(tmp_path, monkeypatch):
    """Return what is set now; it is set again in the end."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    before = {name: getattr(jax.config, name) for name in OPTIONS}
    yield before
    for name, value in before.items():
        jax.config.update(name, value)


def test_a_folder_that_was_chosen_is_kept(options, tmp_path):
    keep_compiled()
    assert {name: getattr(jax.config, name) for name in OPTIONS} == options
    assert not any(tmp_path.iterdir())


def test_otherwise_it_is_the_users_cache(options, tmp_path):
    jax.config.update("jax_compilation_cache_dir", None)
    keep_compiled()
    folder = tmp_path / "contourlab" / "jax"
    assert jax.config.jax_compilation_cache_dir == str(folder)
    assert folder.is_dir()
