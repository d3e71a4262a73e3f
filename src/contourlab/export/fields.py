"""The structures of exported C: which numbers they hold, under which names, in which units.

A field is one array of a pytree: a gain of the law, a part of its state, an input, an output. Its
name is its path. Arrays are flat in C, in the order of memory, last dimension fastest.
"""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import jax
import numpy as np

from contourlab.errors import ExportError
from contourlab.export.expressions import Index, constant, load, name, operation
from contourlab.export.field_docs import described, in_command_unit
from contourlab.export.statements import Builder
from contourlab.export.values import SMALL, Atoms, Rule, Stored, Value

__all__ = ["Field", "fields_of", "value_of"]

_KEYWORDS = frozenset(
    [
        "auto",
        "break",
        "case",
        "char",
        "const",
        "continue",
        "default",
        "do",
        "double",
        "else",
        "enum",
        "extern",
        "float",
        "for",
        "goto",
        "if",
        "inline",
        "int",
        "long",
        "register",
        "restrict",
        "return",
        "short",
        "signed",
        "sizeof",
        "static",
        "struct",
        "switch",
        "typedef",
        "union",
        "unsigned",
        "void",
        "volatile",
        "while",
        "bool",
        "true",
        "false",
    ]
)


@dataclasses.dataclass(frozen=True)
class Field:
    """One member of a structure.

    Parameters
    ----------
    name
        In C.
    shape
        Of the array; () for a scalar.
    unit
        SI unit, as far as it is known.
    dtype
        ``"real"`` or ``"int32"``.
    path
        Where it stands in Python.
    text
        What it is, as the law's source says.
    """

    name: str
    shape: tuple[int, ...]
    unit: str
    dtype: str
    path: str
    text: str = ""

    @property
    def size(self) -> int:
        """Number of elements."""
        return int(np.prod(self.shape, dtype=int))


def fields_of(
    tree: Any, *, what: str, units: dict[str, str] | None = None, command_unit: str = ""
) -> list[Field]:
    """Return the fields of a pytree, one for each leaf, in the order of its leaves.

    Parameters
    ----------
    tree
        Of arrays.
    what
        Name of the tree in messages.
    units
        By path, where the tree's own declarations do not say.
    command_unit
        Of the law's command, in which gains and efforts are told.

    Raises
    ------
    ExportError
        A leaf that is neither real nor a whole number nor a truth.
    """
    found: list[Field] = []
    taken: set[str] = set()
    for path, leaf in jax.tree_util.tree_flatten_with_path(tree)[0]:
        words = [_word(key) for key in path]
        dotted = ".".join(words)
        array = np.asarray(leaf)
        if array.dtype == np.float64 or array.dtype == np.float32:
            kind = "real"
        elif array.dtype in (np.int32, np.bool_):
            kind = "int32"
        else:
            raise ExportError(
                f"{what}: {dotted or 'the value'} is of type {array.dtype}; exported structures "
                "hold float64, int32 and bool"
            )
        said = described(_owners(tree, path))
        unit = (units or {}).get(dotted) or in_command_unit(said.unit, command_unit)
        label = _identifier(words, taken)
        taken.add(label)
        found.append(Field(label, tuple(array.shape), unit, kind, dotted, said.text))
    return found


def _word(key: Any) -> str:
    for attribute in ("name", "key", "idx"):
        if hasattr(key, attribute):
            return str(getattr(key, attribute))
    return str(key).strip(".[]'")


def _identifier(words: list[str], taken: set[str]) -> str:
    text = re.sub(r"\W+", "_", "_".join(words), flags=re.ASCII).strip("_") or "value"
    if text[0].isdigit() or text in _KEYWORDS:
        text = f"x_{text}"
    label, number = text, 2
    while label in taken:
        label, number = f"{text}_{number}", number + 1
    return label


def _owners(tree: Any, path: Any) -> list[tuple[type, str]]:
    """Return class and field name for each named step of a path, from the outermost on."""
    owner, found = tree, []
    for key in path:
        if hasattr(key, "name"):
            found.append((type(owner), str(key.name)))
        owner = _child(owner, key)
    return found


def _child(owner: Any, key: Any) -> Any:
    if hasattr(key, "name"):
        return getattr(owner, key.name, None)
    place = getattr(key, "key", getattr(key, "idx", None))
    try:
        return owner[place]
    except (KeyError, IndexError, TypeError):
        return None


def value_of(builder: Builder, field: Field, structure: str, dtype: Any) -> Value:
    """Return a member of a structure as a value.

    Parameters
    ----------
    builder
        Where statements go.
    field
        Which.
    structure
        Name of the pointer in C.
    dtype
        NumPy type that the law knows it by.
    """
    place = f"{structure}->{field.name}"
    held = np.dtype(np.float64 if field.dtype == "real" else np.int32)

    def element(index: Index) -> Any:
        one = name(place, held) if field.shape == () else load(place, index, held)
        if dtype == np.bool_:
            return operation("ne", np.bool_, one, constant(0, held))
        return operation("cast", dtype, one)

    if field.size <= SMALL:
        elements = [element(Index(k)) for k in range(field.size)]
        if dtype != held or field.shape != ():
            elements = [builder.bind(one) for one in elements]
        return Atoms(builder, field.shape, dtype, elements)
    if dtype == held:
        return Stored(field.shape, dtype, place)

    def rule(builder: Builder, index: Any) -> Any:
        from contourlab.export.values import flat_index

        del builder
        return element(flat_index(field.shape, index))

    return Rule(field.shape, dtype, rule, cheap=True)
