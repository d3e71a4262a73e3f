"""Configurations convert, check, stay frozen, and can be changed by path."""

import dataclasses

import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from contourlab.configuration import Configuration, part, real, replace, replace_at, resolve, static
from contourlab.contours import Circle, Path
from contourlab.errors import ConfigurationError


class Gains(Configuration):
    kp: object = real(unit="V/m", minimum=0.0)
    cutoff: object = real(unit="Hz", above=0.0, finite=False, default=np.inf)
    order: int = static(minimum=1, default=2)
    kind: str = static(allowed=("slow", "fast"), default="slow")

    def check(self):
        if np.any(self.kp > 1e6):
            raise ConfigurationError("kp is absurd")


class Placed(Configuration):
    position: object = real(unit="m", ndim=1)
    normal: object = real(ndim=1, default=None)
    clockwise: bool = static(flag=True, default=False)


class Law(Configuration):
    gains: Gains = part()
    ki: object = real(default=0.0)


def test_numbers_become_float64_leaves():
    gains = Gains(kp=3)
    assert gains.kp.dtype == np.float64
    assert isinstance(gains.kp, np.ndarray)
    assert len(jax.tree.leaves(gains)) == 2
    assert Gains(kp=jnp.float32(2)).kp.dtype == jnp.float64


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kp": -1.0}, "kp must be >= 0 V/m, got -1"),
        ({"kp": np.nan}, "kp must be finite, got nan V/m"),
        ({"kp": [1.0, -2.0]}, "got -2"),
        ({"kp": 1.0, "cutoff": 0.0}, "cutoff must be > 0 Hz, got 0"),
        ({"kp": 1.0, "order": 0}, "order must be a whole number >= 1, got 0"),
        ({"kp": 1.0, "kind": "fasst"}, "did you mean fast?"),
        ({"kp": 1e7}, "kp is absurd"),
    ],
)
def test_messages_name_value_and_bound(values, message):
    with pytest.raises(ConfigurationError, match=message.replace("?", r"\?")):
        Gains(**values)


@pytest.mark.parametrize(
    "value",
    [
        "0.1 um", b"1", None, True, np.True_, {"x": 1.0}, ["1", "2"], [1.0, None], [True, False],
        [[1.0, 2.0], [3.0]], np.array([True]), np.array([1j]), 1j, jnp.array([True]),
        {1.0}, Gains(kp=1.0),
    ],
    ids=repr,
)  # fmt: skip
def test_what_is_no_number_is_refused(value):
    with pytest.raises(ConfigurationError, match=r"^position must be a number, got "):
        Placed(position=value)
    with pytest.raises(ConfigurationError, match=r"^position must be a number, got "):
        replace(Placed(position=[0.0, 1.0]), position=value)


def test_the_message_shows_what_was_given():
    with pytest.raises(ConfigurationError, match=r"^position must be a number, got '0.1 um'$"):
        Placed(position="0.1 um")
    with pytest.raises(ConfigurationError, match=r"number, got \[\[1.0, 2.0\], \[3.0\]\]$"):
        Placed(position=[[1.0, 2.0], [3.0]])


def test_none_only_where_it_is_the_default():
    assert Placed(position=[0.0, 1.0], normal=None).normal is None
    with pytest.raises(ConfigurationError, match="normal must be a number, got 'z'"):
        Placed(position=[0.0, 1.0], normal="z")


@pytest.mark.parametrize(
    "value", [object(), jax.ShapeDtypeStruct((2,), np.float64)], ids=["object", "shape"]
)
def test_placeholders_pass(value):
    assert Placed(position=value).position is value


@pytest.mark.parametrize("value", [3, np.int32(3), np.float32(3), [3], (3, 4.0), np.arange(2)])
def test_every_kind_of_number_passes(value):
    position = Placed(position=value).position
    assert position.dtype == np.float64
    assert_array_equal(position, value)


@pytest.mark.parametrize("value", ["no", 1, 0, None, [True]])
def test_a_flag_is_true_or_false(value):
    with pytest.raises(ConfigurationError, match=r"^clockwise must be True or False, got "):
        Placed(position=0.0, clockwise=value)
    assert Placed(position=0.0, clockwise=np.True_).clockwise is True


def test_flags_of_contours(monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for a user
    with pytest.raises(ConfigurationError, match="clockwise must be True or False, got 'no'"):
        Circle(radius=1.0, clockwise="no")
    path = Path.polyline([[0.0, 0.0], [1.0, 0.0]])
    with pytest.raises(ConfigurationError, match="is_closed must be True or False, got 'no'"):
        replace(path, is_closed="no")


def test_frozen_and_keyword_only():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Gains(kp=1.0).kp = 2.0
    with pytest.raises(TypeError):
        Gains(1.0)


def test_replace_validates():
    gains = Gains(kp=1.0)
    assert replace(gains, kp=2.0).kp == 2.0
    with pytest.raises(ConfigurationError, match="kp must be >= 0"):
        replace(gains, kp=-2.0)
    with pytest.raises(ConfigurationError, match="did you mean kp"):
        replace(gains, kpp=2.0)


def test_replace_at_reaches_inside_and_validates():
    law = Law(gains=Gains(kp=1.0))
    assert replace_at(law, "gains.kp", 5.0).gains.kp == 5.0
    assert replace_at((law,), "0.gains.kp", 5.0)[0].gains.kp == 5.0
    with pytest.raises(ConfigurationError, match="kp must be >= 0"):
        replace_at(law, "gains.kp", -5.0)
    with pytest.raises(ConfigurationError, match="no field 'gain'"):
        replace_at(law, "gain.kp", 5.0)


def test_resolve_finds_what_stands_once():
    law = Law(gains=Gains(kp=1.0))
    assert resolve({"law": law}, "law.kp") == "law.gains.kp"
    with pytest.raises(ConfigurationError, match="holds several"):
        resolve({"a": law, "b": law}, "kp")
    with pytest.raises(ConfigurationError, match="has no field"):
        resolve(law, "nothing")


def test_batches_are_checked_as_a_whole():
    with pytest.raises(ConfigurationError, match="got -1"):
        Gains(kp=np.array([1.0, 2.0, -1.0]))


def test_checks_are_skipped_while_traced_and_the_tree_survives_transformations():
    def value(kp):
        return Gains(kp=kp).kp * 2.0

    assert_array_equal(jax.vmap(value)(jnp.array([-1.0, 1.0])), [-2.0, 2.0])
    assert jax.grad(value)(3.0) == 2.0
    doubled = jax.tree.map(lambda x: 2 * x, Gains(kp=2.0))
    assert doubled.kp == 4.0


def test_changing_a_number_does_not_recompile():
    count = []

    @jax.jit
    def run(gains):
        count.append(1)
        return gains.kp + 1.0

    run(Gains(kp=1.0))
    run(Gains(kp=2.0))
    assert len(count) == 1
    run(Gains(kp=2.0, kind="fast"))
    assert len(count) == 2
