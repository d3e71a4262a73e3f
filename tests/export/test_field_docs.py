"""Units and words of exported numbers: read from the law's own source."""

from typing import NamedTuple

import equinox as eqx
import pytest

from contourlab.configuration import Configuration, part, real
from contourlab.export.field_docs import described, in_command_unit
from contourlab.export.generate import comment


class Pair(NamedTuple):
    """A signal and its rate."""

    value: float
    """The last value."""
    rate: float
    """The last rate."""


class State(NamedTuple):
    """What a law remembers."""

    integral: float
    """Integral of the *error*, shape (n_axes,) [m s]. Held at the limit."""
    pair: Pair
    """Of the error [m], [m/s]."""
    plain: float


class Law(Configuration):
    """A law.

    Parameters
    ----------
    gain, other
        Stiffness of the loop,
        >= 0 [command unit per m].
    """

    gain: float = real(minimum=0.0)
    other: float = real(unit="1/s")


class BoundLaw(Configuration):
    """It, bound."""

    gain: float = real()
    inner: eqx.Module = part()


def test_what_the_source_says_of_a_field():
    found = described([(State, "integral")])
    assert (found.text, found.unit) == ("Integral of the error", "m s")
    assert described([(State, "plain")]).text == ""
    assert described([(State, "pair"), (Pair, "rate")]).unit == "m/s"
    assert described([(State, "pair"), (Pair, "value")]).text == "The last value"
    # two units and one field: none of them is taken
    assert described([(State, "pair")]).unit == ""


def test_a_bound_law_is_told_by_its_configuration():
    found = described([(BoundLaw, "gain")])
    assert (found.text, found.unit) == ("Stiffness of the loop, >= 0", "command unit per m")
    assert described([(Law, "other")]).unit == "1/s"  # what is declared comes first


@pytest.mark.parametrize(("unit", "wanted"), [
    ("command unit", "V"), ("command unit per m", "V/m"), ("command unit per m s", "V/(m s)"),
    ("command unit per m/s", "V s/m"), ("command unit per m/s^2", "V s^2/m"),
    ("m^2 per squared command unit", "m^2/V^2"), ("command unit s", "V s"), ("1/s", "1/s"),
])  # fmt: skip
def test_the_unit_of_the_command_is_put_in(unit, wanted):
    assert in_command_unit(unit, "V") == wanted
    assert in_command_unit(unit, "") == unit


def test_words_cannot_end_a_comment():
    assert comment("a */ b /* c \\") == "/* a * / b / * c */"
    assert comment("") == ""
