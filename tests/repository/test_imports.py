"""Imports point up the list of packages in design and architecture; heavy ones come late."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "contourlab"

LAYERS = [
    ["errors", "units", "typing", "configuration"],
    ["contours"],
    ["recordings"],
    ["feedrate"],
    ["contour_errors"],
    ["machines"],
    ["controllers"],
    ["simulation"],
    ["logs"],
    ["identification"],
    ["evaluation"],
    ["tuning", "studies"],
    ["export"],
    ["reports"],
    ["papers"],
    ["scenarios"],
    ["testing"],
    ["cli", "__main__"],
]
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}
WITHIN = {"units": {"errors"}, "configuration": {"errors"}}


def modules():
    return sorted(SOURCE.rglob("*.py"))


def package_of(path: Path) -> str:
    relative = path.relative_to(SOURCE)
    return relative.parts[0].removesuffix(".py")


def imported(tree: ast.AST):
    """Yield (package, whether at run time) of every contourlab import."""
    typing_only = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            typing_only.update(id(inner) for inner in ast.walk(node))
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names = [node.module]
            if node.module == "contourlab":
                names = [f"contourlab.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            parts = name.split(".")
            if parts[0] == "contourlab" and len(parts) > 1:
                yield parts[1], id(node) not in typing_only


def downward(path: Path, text: str) -> list[str]:
    own = package_of(path)
    wrong = []
    for package, _ in imported(ast.parse(text)):
        if package in ("__version__", own) or package not in LEVEL:
            continue
        if LEVEL[package] > LEVEL[own]:
            wrong.append(f"{own} imports {package}")
        if LEVEL[package] == LEVEL[own] and package not in WITHIN.get(own, {package}):
            wrong.append(f"{own} imports its neighbour {package}")
    return wrong


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(SOURCE)))
def test_imports_point_up(path):
    if path == SOURCE / "__init__.py":
        return
    assert package_of(path) in LEVEL, f"{path} is in no layer"
    assert downward(path, path.read_text()) == []


def test_the_check_sees_a_wrong_import():
    path = SOURCE / "contours" / "base.py"
    assert downward(path, "from contourlab.simulation import simulate") == [
        "contours imports simulation"
    ]


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(SOURCE)))
def test_plots_only_in_reports(path):
    roots = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            roots.update(alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            roots.add(node.module.split(".")[0])
    if package_of(path) != "reports":
        assert not roots & {"matplotlib", "plotly"}
    if package_of(path) != "tuning":
        assert not roots & {"optuna"}


def _loaded_after(statement: str) -> set[str]:
    code = f"import sys; {statement}; print(' '.join(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return {name.split(".")[0] for name in run.stdout.split()}


def test_import_contourlab_is_light():
    loaded = _loaded_after("import contourlab")
    assert not loaded & {"jax", "numpy", "xarray", "matplotlib", "plotly", "pydantic", "scipy"}


def test_the_command_line_starts_without_jax():
    loaded = _loaded_after("import contourlab.cli")
    assert not loaded & {"jax", "numpy", "xarray", "matplotlib", "plotly", "pydantic", "scipy"}


def test_reports_are_imported_without_plots():
    loaded = _loaded_after("import contourlab.reports")
    assert not loaded & {"matplotlib", "plotly"}


@pytest.mark.parametrize("order", ["import contourlab, jax", "import jax, contourlab"])
def test_import_means_float64(order):
    code = f"{order}; import jax.numpy as jnp; assert jnp.zeros(1).dtype == 'float64'"
    subprocess.run([sys.executable, "-c", code], check=True)
