"""Every public name imports, and every public docstring speaks of the parameters that exist."""

import dataclasses
import importlib
import inspect
import pkgutil
import re

import pytest
from numpydoc.docscrape import NumpyDocString

import contourlab

MODULES = sorted(
    m.name
    for m in pkgutil.walk_packages(contourlab.__path__, "contourlab.")
    if not m.name.endswith("__main__")
)


@pytest.mark.parametrize("name", ["contourlab", *MODULES])
def test_every_name_in_all_exists(name):
    module = importlib.import_module(name)
    for public in getattr(module, "__all__", ()):
        assert getattr(module, public) is not None, f"{name}.{public}"


def public_callables():
    seen = set()
    for name in MODULES:
        module = importlib.import_module(name)
        for public in getattr(module, "__all__", ()):
            value = getattr(module, public)
            if not getattr(value, "__module__", "").startswith("contourlab") or id(value) in seen:
                continue
            seen.add(id(value))
            if inspect.isfunction(value):
                yield f"{name}.{public}", value
            elif inspect.isclass(value):
                for key, member in vars(value).items():
                    function = getattr(member, "__func__", member)
                    function = inspect.unwrap(getattr(function, "__wrapped__", function))
                    if inspect.isfunction(function) and not key.startswith("_"):
                        yield f"{name}.{public}.{key}", function


CALLABLES = dict(public_callables())
HOUSES = {m for m in MODULES if m.count(".") == 1 or m.startswith("contourlab.testing.")}
PUBLIC_OBJECTS = {
    id(getattr(importlib.import_module(module), name))
    for module in HOUSES
    for name in getattr(importlib.import_module(module), "__all__", ())
}


def is_public(name):
    module, _, rest = name.rpartition(".")
    try:
        owner = getattr(importlib.import_module(module), rest)
    except ModuleNotFoundError:  # a method: its class counts
        module, _, rest = module.rpartition(".")
        owner = getattr(importlib.import_module(module), rest)
    return id(owner) in PUBLIC_OBJECTS


PUBLIC = {name for name in CALLABLES if is_public(name)}


def documented_and_real(function):
    documentation = NumpyDocString(inspect.getdoc(function) or "")
    documented = [
        part.strip().lstrip("*")
        for parameter in documentation["Parameters"]
        for part in parameter.name.split(",")
    ]
    real = [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]
    return documented, real


@pytest.mark.parametrize("name", sorted(CALLABLES))
def test_docstring_parameters_are_the_real_ones(name):
    function = CALLABLES[name]
    assert inspect.getdoc(function), f"{name} has no docstring"
    documented, real = documented_and_real(function)
    if documented or (real and name in PUBLIC):
        assert sorted(documented) == sorted(real), name


def test_public_names_are_found():
    assert len(PUBLIC) > 100


def documented_configurations():
    from contourlab.configuration import Configuration

    for name in sorted(HOUSES):
        module = importlib.import_module(name)
        for public in getattr(module, "__all__", ()):
            value = getattr(module, public)
            if inspect.isclass(value) and issubclass(value, Configuration):
                named = NumpyDocString(inspect.getdoc(value) or "")["Parameters"]
                if named and "Parameters" in (value.__doc__ or ""):
                    yield f"{name}.{public}", value, named


@pytest.mark.parametrize(
    ("name", "value", "named"),
    list(documented_configurations()),
    ids=[name for name, _, _ in documented_configurations()],
)
def test_documented_fields_are_the_real_ones(name, value, named):
    documented = {part.strip() for p in named for part in p.name.split(",")}
    real = {f.name for f in dataclasses.fields(value) if f.init}
    assert documented == real, name


def test_the_check_sees_a_parameter_that_is_gone():
    def stale(new):
        """Do.

        Parameters
        ----------
        old
            Gone.
        """

    assert documented_and_real(stale) == (["old"], ["new"])


def test_every_citation_resolves_and_every_entry_is_used():
    from pathlib import Path

    root = Path(__file__).parents[2]
    bibliography = root / "docs" / "references.bib"
    entries = set(re.findall(r"@\w+\{\s*([^,\s]+)", bibliography.read_text()))
    used = set()
    for path in (root / "src").rglob("*.py"):
        used |= set(re.findall(r"^\s*\.\. \[([\w-]+)\]", path.read_text(), re.MULTILINE))
    assert used == entries
