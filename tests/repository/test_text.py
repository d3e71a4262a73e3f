"""README, pyproject and the files they speak of agree, and the README's code runs."""

import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


TEXTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SNIPPETS = [
    (path.name, code)
    for path in TEXTS
    for code in re.findall(r"```python\n(.*?)```", path.read_text(), re.DOTALL)
]


def test_there_are_snippets():
    assert {"README.md", "own_law.md"} <= {name for name, _ in SNIPPETS}


EXAMPLES = sorted((ROOT / "examples").glob("[0-9][0-9]_*.py"))


@pytest.mark.parametrize(("name", "code"), SNIPPETS, ids=[name for name, _ in SNIPPETS])
def test_snippets_run(name, code, tmp_path, monkeypatch):
    """Here, with names of their own: importing again would take longer than most of them."""
    monkeypatch.chdir(tmp_path)
    script = tmp_path / "snippet.py"
    script.write_text(code)
    runpy.run_path(str(script), run_name="__main__")


def test_the_first_snippet_and_example_run_as_programs(tmp_path):
    readme = next(code for name, code in SNIPPETS if name == "README.md")
    subprocess.run([sys.executable, "-c", readme], check=True, cwd=tmp_path, timeout=600)
    subprocess.run([sys.executable, str(EXAMPLES[0])], check=True, cwd=tmp_path, timeout=600)


def test_readme_names_files_that_exist():
    for name in re.findall(r"\]\(((?!https?:|#)[^)]+)\)", README):
        assert (ROOT / name).exists(), name
    for name in re.findall(r"examples/[\w./-]+", README):
        assert (ROOT / name.rstrip(".")).exists(), name


def test_readme_commands_name_real_extras():
    extras = set(PROJECT["project"]["optional-dependencies"])
    named = set(re.findall(r"\.\[([\w,]+)\]", README))
    assert named, "the README installs an extra"
    assert {extra for group in named for extra in group.split(",")} <= extras


def test_python_versions_agree():
    least = re.search(r">=\s*(3\.\d+)", PROJECT["project"]["requires-python"])[1]
    assert f"Python {least}" in README


def test_configured_paths_exist():
    options = PROJECT["tool"]
    for path in (
        *options["pytest"]["ini_options"]["testpaths"],
        *options["ruff"]["src"],
        options["mypy"]["mypy_path"],
        *options["hatch"]["build"]["targets"]["wheel"]["packages"],
    ):
        assert (ROOT / path).exists(), path


def test_version_is_one():
    import contourlab

    version = PROJECT["project"]["version"]
    assert contourlab.__version__ == version
    assert f"version: {version}" in (ROOT / "CITATION.cff").read_text()
    assert f"[{version}]" in (ROOT / "CHANGELOG.md").read_text()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.name)
def test_examples_run(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(path)])
    runpy.run_path(str(path), run_name="__main__")


def test_no_lock_files():
    names = {path.name for path in ROOT.iterdir()}
    assert not names & {"uv.lock", "poetry.lock", "pdm.lock", "Pipfile.lock"}
