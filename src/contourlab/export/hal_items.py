"""A law's gains and telemetry as HAL parameters and pins: their names, and the C that copies them.

HAL's names have at most 47 characters, the component's name and the index included; longer ones are
shortened word by word, and numbered where that is not enough. A field of many numbers is a table,
not a gain, and is not shown.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

from contourlab.export.fields import Field
from contourlab.export.generate import GeneratedC

__all__ = ["HalItem", "gain_items", "telemetry_items"]

HAL_NAME_LENGTH = 47
MOST_ELEMENTS = 16
"""Fields with more numbers than that are not shown as parameters or pins."""
SHORTER = {
    "feed_forward": "ff",
    "acceleration": "acc",
    "velocity": "vel",
    "derivative": "deriv",
    "friction": "fric",
    "position": "pos",
    "estimator": "est",
    "estimate": "est",
    "disturbance": "dist",
    "contour": "cont",
    "error": "err",
}
"""How words are shortened in names that are too long for HAL, in this order."""


@dataclasses.dataclass(frozen=True)
class HalItem:
    """A number of the law as HAL shows it."""

    field: Field
    hal: str
    """Name in the component's source, ``#`` standing for the index."""
    array: str
    """``[n]``, or nothing for one number."""
    text: str
    setup: str = ""
    read: str = ""
    write: str = ""

    @property
    def shown(self) -> str:
        """Name under the component, as ``halcmd`` prints it; ``N`` stands for the index."""
        return self.hal.replace("_", "-").replace("#", "N")


def gain_items(generated: GeneratedC) -> tuple[list[HalItem], list[Field]]:
    """Return the law's parameters as HAL parameters, and those that are too many numbers.

    Parameters
    ----------
    generated
        The exported law.
    """
    shown = [f for f in generated.parameters if f.dtype == "real" and f.size <= MOST_ELEMENTS]
    hidden = [f for f in generated.parameters if f not in shown]
    items = []
    for field, name in zip(shown, _hal_names(generated.prefix, "law", shown), strict=True):
        place, inst = f"servo_settings.law.{field.name}", f"inst->{_c_name(name)}"
        real = f"({generated.prefix}_real)"
        if field.shape == ():
            setup, read = f"{inst} = (double){place};", f"{place} = {real}{inst};"
        else:
            loop = f"for (i = 0; i < {field.size}; i++) "
            setup = f"{loop}{inst}[i] = (double){place}[i];"
            read = f"{loop}{place}[i] = {real}{inst}[i];"
        items.append(HalItem(field, name, _array(field), _text(field), setup=setup, read=read))
    return items, hidden


def telemetry_items(generated: GeneratedC) -> list[HalItem]:
    """Return what the law shows of itself as HAL pins.

    Parameters
    ----------
    generated
        The exported law.
    """
    fields = [
        f
        for f in generated.outputs
        if f.name not in ("command", "status", "finished") and f.size <= MOST_ELEMENTS
    ]
    items = []
    names = _hal_names(generated.prefix, "telemetry", fields)
    for field, name in zip(fields, names, strict=True):
        place, inst = f"servo_outputs.law.{field.name}", f"inst->{_c_name(name)}"
        if field.shape == ():
            write = f"*{inst} = (double){place};"
        else:
            write = f"for (i = 0; i < {field.size}; i++) *{inst}[i] = (double){place}[i];"
        items.append(HalItem(field, name, _array(field), _text(field), write=write))
    return items


def _array(field: Field) -> str:
    return "" if field.shape == () else f"[{field.size}]"


def _text(field: Field) -> str:
    return f"{field.path or field.name} [{field.unit}]" if field.unit else field.path or field.name


def _c_name(name: str) -> str:
    """Return what halcompile calls a pin or parameter in C."""
    return re.sub("_+", "_", re.sub(r"[.\-]", "_", re.sub(r"[-._]*#+", "", name)))


def _hal_names(prefix: str, group: str, fields: Sequence[Field]) -> list[str]:
    """Return names that HAL can take: shortened where too long, else numbered."""
    names: list[str] = []
    taken: set[str] = set()
    rooms = [
        HAL_NAME_LENGTH - len(prefix) - len(group) - 2
        - (0 if field.shape == () else 1 + len(str(field.size - 1)))
        for field in fields
    ]  # fmt: skip
    shortened = [field.name for field in fields]
    for word, short in SHORTER.items():  # in all names alike, as far as the longest needs it
        if all(len(name) <= room for name, room in zip(shortened, rooms, strict=True)):
            break
        shortened = [name.replace(word, short) for name in shortened]
    for number, (field, name, room) in enumerate(zip(fields, shortened, rooms, strict=True)):
        shown = {f"{name}_{k}" for k in range(field.size)} if field.shape else {name}
        if len(name) > room or shown & taken or name.endswith("_"):
            name = f"number{number}"
            shown = {f"{name}_{k}" for k in range(field.size)} if field.shape else {name}
        taken |= shown
        names.append(f"{group}.{name}{'_#' if field.shape else ''}")
    return names
