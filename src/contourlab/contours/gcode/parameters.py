"""Parameters: numbered ones, and named ones that belong to the program or to one call.

``#1`` to ``#5601`` are 0 until they are set; ``#1`` to ``#30`` belong to the call of a subprogram.
``#<name>`` belongs to the call, ``#<_name>`` to the program; reading one that was never set is
refused. As in LinuxCNC a name exists from the moment its assignment begins: in ``#<a>=[#<a>+1]``
the old value is 0 when there is none, and the reader warns.

What the program cannot know is refused with its reason: tools, probing, stored positions, inputs,
the machine's ini file and pins. What it can know (positions, offsets, modes) is read-only and
computed: :mod:`~contourlab.contours.gcode.predefined`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from contourlab.errors import GcodeError

__all__ = ["ARGUMENTS", "EQUAL", "LAST", "MOST_NAMES", "Parameters", "whole"]

EQUAL = 0.0001
"""Numbers nearer than this are equal, and nearer than this to a whole number are whole."""

LAST = 5601
"""Largest parameter number."""

ARGUMENTS = 30
"""Parameters that belong to a call."""

MOST_NAMES = 100_000
"""Named parameters of one call, or of the program."""

_NOT_KNOWN: tuple[tuple[range, str], ...] = (
    (range(5061, 5071), "a probed position"),
    (range(5161, 5170), "a stored position (G28)"),
    (range(5181, 5190), "a stored position (G30)"),
    (range(5399, 5400), "an input (M66)"),
    (range(5400, 5414), "the tool"),
    (range(5600, 5602), "a tool changer's fault"),
)
_READ_ONLY = frozenset((*range(5400, 5414), *range(5420, 5429)))
_ELSEWHERE = {"_ini[": "the machine's ini file", "_hal[": "the machine's pins"}


def whole(value: float) -> int:
    """Return a value as a whole number.

    Parameters
    ----------
    value
        Within 0.0001 of a whole number.

    Raises
    ------
    GcodeError
        It is not.
    """
    number = math.floor(value + 0.5)
    if abs(value - number) > EQUAL:
        raise GcodeError(f"a whole number is needed, got {value:g}")
    return number


class Parameters:
    """All parameters of a program.

    Parameters
    ----------
    computed
        Read-only numbered parameters that are worked out when they are read.
    predefined
        Read-only named parameters that are worked out when they are read.
    unknown
        Predefined names that need more than the program, with what they need.
    """

    def __init__(
        self,
        computed: Mapping[int, Callable[[], float]],
        predefined: Mapping[str, Callable[[], float]],
        unknown: Mapping[str, str],
    ) -> None:
        self.numbers: dict[int, float] = {5220: 1.0, 5599: 1.0}
        """Values by number; 0 if missing."""
        self.program: dict[str, float] = {}
        """Named parameters that begin with an underscore."""
        self.call: dict[str, float] = {}
        """Named parameters of the call that is running."""
        self.unset: set[str] = set()
        """Names whose first assignment has begun and not ended."""
        self.surprises: set[str] = set()
        """Names that were read while they were unset."""
        self._computed, self._predefined, self._unknown = computed, predefined, unknown

    @staticmethod
    def in_range(number: int) -> bool:
        """Return whether there is a parameter of that number.

        Parameters
        ----------
        number
            From 1 to 5601.
        """
        return 1 <= number <= LAST

    def number(self, number: int) -> float:
        """Return a numbered parameter.

        Parameters
        ----------
        number
            Which.

        Raises
        ------
        GcodeError
            No such number, or one whose value only the machine knows.
        """
        value = self.numbers.get(number)
        if value is not None:
            return value
        if number < 5061:
            if number < 1:
                raise GcodeError(f"parameters have numbers from 1 to {LAST}, got {number}")
            return 0.0
        if number > LAST:
            raise GcodeError(f"parameters have numbers from 1 to {LAST}, got {number}")
        if number in self._computed:
            return self._computed[number]()
        for numbers, what in _NOT_KNOWN:
            if number in numbers:
                raise GcodeError(f"parameter {number} depends on {what}, which is not known here")
        return 0.0

    def set_number(self, number: int, value: float) -> None:
        """Set a numbered parameter.

        Parameters
        ----------
        number, value
            Which, and to what.

        Raises
        ------
        GcodeError
            No such number, or a read-only one.
        """
        if not 1 <= number <= LAST:
            raise GcodeError(f"parameters have numbers from 1 to {LAST}, got {number}")
        if number in _READ_ONLY:
            raise GcodeError(f"parameter {number} is read-only")
        if number == 5399:
            raise GcodeError("parameter 5399 depends on an input (M66), which is not known here")
        self.numbers[number] = value

    def named(self, name: str) -> float:
        """Return a named parameter.

        Parameters
        ----------
        name
            In lower case.

        Raises
        ------
        GcodeError
            Never set, or known only to the machine.
        """
        value = (self.program if name[0] == "_" else self.call).get(name)
        if value is not None:
            if self.unset and name in self.unset:
                self.surprises.add(name)
            return value
        if name in self._predefined:
            return self._predefined[name]()
        self._refuse_unknown(name)
        raise GcodeError(f"the parameter #<{name}> has no value yet")

    def exists(self, name: str) -> bool:
        """Return whether a named parameter has been set.

        Parameters
        ----------
        name
            In lower case.

        Raises
        ------
        GcodeError
            One that only the machine knows.
        """
        if name[:5] in _ELSEWHERE:
            self._refuse_unknown(name)
        names = self.program if name[0] == "_" else self.call
        return name in names or name in self._predefined or name in self._unknown

    def declare(self, name: str) -> None:
        """Begin the assignment of a named parameter: from here on it exists.

        Parameters
        ----------
        name
            In lower case.

        Raises
        ------
        GcodeError
            A read-only parameter, or too many names.
        """
        names = self.program if name[0] == "_" else self.call
        if name in names:
            return
        if name in self._predefined or name in self._unknown or name[:5] in _ELSEWHERE:
            raise GcodeError(f"the parameter #<{name}> is read-only")
        if len(names) >= MOST_NAMES:
            raise GcodeError(f"the program has more than {MOST_NAMES} named parameters")
        names[name] = 0.0
        self.unset.add(name)

    def set_named(self, name: str, value: float) -> None:
        """Set a named parameter.

        Parameters
        ----------
        name, value
            Which, declared before, and to what.
        """
        (self.program if name[0] == "_" else self.call)[name] = value
        self.unset.discard(name)

    def _refuse_unknown(self, name: str) -> None:
        what = self._unknown.get(name) or _ELSEWHERE.get(name[:5])
        if what:
            raise GcodeError(f"#<{name}> depends on {what}, which is not known here")
