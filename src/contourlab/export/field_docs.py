"""What a number of the law is and in which unit: read where the law's own source says it.

A field is described by the text below it in its class, or by its entry among the ``Parameters`` of
the class; one of a bound law that has neither, by the configuration that it was bound from, which
is called the same without ``Bound``. The unit is the one that the field declares, or the one in
brackets at the end of its text. A user's own law is read in the same way.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import inspect
import itertools
import re
import sys
import textwrap
from collections.abc import Sequence

__all__ = ["COMMAND_UNIT", "Described", "described", "in_command_unit"]

COMMAND_UNIT = "command unit"
"""How laws write the unit of their command, which they do not know before they have a model."""


@dataclasses.dataclass(frozen=True)
class Described:
    """What is said of a field.

    Parameters
    ----------
    text
        The first sentence about it.
    units
        All units in brackets, or the one that it declares.
    """

    text: str = ""
    units: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """The unit, if there is one."""
        return self.units[0] if len(self.units) == 1 else ""


def described(owners: Sequence[tuple[type, str]]) -> Described:
    """Return what is said of a field, with the unit that its owner's owner knows if it does not.

    Parameters
    ----------
    owners
        Class and name of the field, from the outermost on.
    """
    if not owners:
        return Described()
    cls, name = owners[-1]
    found = _of_class(cls, name)
    if found.units or len(owners) < 2:
        return found
    # "Of the error [m], [m/s]": one unit for each field of what the outer field holds
    outer, inner = _of_class(*owners[-2]), getattr(cls, "_fields", ())
    if name in inner and len(outer.units) == len(inner):
        return dataclasses.replace(found, units=(outer.units[inner.index(name)],))
    return found


def in_command_unit(unit: str, command: str) -> str:
    """Return a unit with that of the command put in.

    Parameters
    ----------
    unit
        Such as ``command unit per m/s``.
    command
        Such as ``V``; empty where it is not known.
    """
    if COMMAND_UNIT not in unit or not command:
        return unit
    unit = unit.replace(f"squared {COMMAND_UNIT}", f"{command}^2").replace(COMMAND_UNIT, command)
    top, per, below = unit.partition(" per ")
    if not per:
        return unit
    if "/" in below:  # V per m/s is V s/m
        rest, _, last = below.partition("/")
        top, below = f"{top} {last}", rest
    return f"{top}/({below})" if " " in below else f"{top}/{below}"


@functools.cache
def _of_class(cls: type, name: str) -> Described:
    declared = ""
    if dataclasses.is_dataclass(cls):
        for field in dataclasses.fields(cls):
            if field.name == name:
                declared = field.metadata.get("real", {}).get("unit", "")
    text = ""
    for base in _told_by(cls):
        text = _field_texts(base).get(name, "")
        if text:
            break
    units = tuple(_plain(one) for one in re.findall(r"\[([^\]]+)\]", text))
    return Described(_sentence(text), (declared,) if declared else units)


def _told_by(cls: type) -> list[type]:
    """Return the classes that may speak of a field: the class, its bases, their configurations."""
    found = [base for base in cls.__mro__ if base is not object]
    for base in list(found):
        module = sys.modules.get(base.__module__)
        plain = getattr(module, base.__name__.removeprefix("Bound"), None)
        if base.__name__.startswith("Bound") and isinstance(plain, type):
            found += [one for one in plain.__mro__ if one is not object and one not in found]
    return found


@functools.cache
def _field_texts(cls: type) -> dict[str, str]:
    """Return what a class says of its fields, by name."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(cls)))
    except (OSError, TypeError, SyntaxError):
        return {}
    body = tree.body[0].body if tree.body and isinstance(tree.body[0], ast.ClassDef) else []
    found = _parameters(inspect.getdoc(cls) if cls.__doc__ else None)
    for field, after in itertools.pairwise(body):
        if (
            isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
            and isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            and isinstance(after.value.value, str)
        ):  # fmt: skip
            found[field.target.id] = inspect.cleandoc(after.value.value)
    return found


def _parameters(doc: str | None) -> dict[str, str]:
    """Return the entries of a docstring's ``Parameters``."""
    _, _, rest = (doc or "").partition("Parameters\n----------\n")
    found: dict[str, str] = {}
    names: list[str] = []
    lines = rest.splitlines()
    for line, after in itertools.pairwise([*lines, ""]):
        if line[:1].strip():
            if set(after.strip()) == {"-"}:  # the next section
                break
            names = [one.strip() for one in line.split(":")[0].split(",")]
        elif line.strip():
            for name in names:
                found[name] = f"{found.get(name, '')} {line.strip()}".strip()
    return found


def _sentence(text: str) -> str:
    """Return the first sentence, without markup, shapes and units."""
    text = " ".join(text.split())
    text = re.sub(r":\w+:`~?(?:[\w.]*\.)?(\w+)`", r"\1", text)
    text = re.sub(r"[`*]", "", text)
    text = re.sub(r"\s*\[[^\]]*\]", "", text)
    text = re.sub(r"[,;]?\s*(shape \([^)]*\)|int32)", "", text)
    return re.split(r"[.;](?:\s|$)", text, maxsplit=1)[0].strip(" .,;")


def _plain(unit: str) -> str:
    """Return a unit in ASCII."""
    for sign, plain in (("²", "^2"), ("³", "^3"), ("·", " "), ("per unit of command", "")):
        unit = unit.replace(sign, plain)
    if unit == "command":
        unit = COMMAND_UNIT
    return unit.strip()
