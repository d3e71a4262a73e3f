"""Every primitive in C against JAX, on awkward numbers; what cannot be exported is refused."""

import ctypes
import subprocess

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from numpy.testing import assert_allclose, assert_array_equal

from contourlab.errors import ExportError
from contourlab.export.compiled import find_compiler
from contourlab.export.expressions import constant, operation
from contourlab.export.functions import compile_function, function_source
from contourlab.export.primitives.table import HANDLERS
from contourlab.export.scalar_types import Precision, literal

from .functions import REALS, everything

STRICT = ("-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-pedantic")
FUNCTIONS = everything()
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler is installed")


@pytest.fixture(scope="module")
def expected():
    """All of them in one go: compiling them one by one takes a minute."""
    arguments = {name: arguments for name, (_, arguments) in FUNCTIONS.items()}
    every = jax.jit(lambda given: {name: f(*given[name]) for name, (f, _) in FUNCTIONS.items()})
    return every(arguments)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("functions")
    made = {
        name: function_source(function, *arguments, name=f"f_{name}")
        for name, (function, arguments) in FUNCTIONS.items()
    }
    source, library = folder / "all.c", folder / "all.so"
    source.write_text("\n".join(one.source for one in made.values()))
    subprocess.run(
        [find_compiler(), *STRICT, "-fPIC", "-shared", "-o", library, source, "-lm"], check=True
    )
    loaded = ctypes.CDLL(str(library))

    def call(name):
        one = made[name]
        inputs = [
            np.ascontiguousarray(x, dtype)
            for x, (_, dtype) in zip(jax.tree.leaves(FUNCTIONS[name][1]), one.inputs, strict=True)
        ]
        outputs = [np.zeros(shape, dtype) for shape, dtype in one.outputs]
        getattr(loaded, one.name)(*(x.ctypes.data_as(ctypes.c_void_p) for x in (*inputs, *outputs)))
        return outputs

    return call


@needs_compiler
@pytest.mark.parametrize("name", FUNCTIONS)
def test_it_is_what_jax_computes(name, expected, exported):
    for theirs, ours in zip(jax.tree.leaves(expected[name]), exported(name), strict=True):
        theirs = np.asarray(theirs)
        assert theirs.dtype == ours.dtype
        if theirs.dtype.kind != "f":
            assert_array_equal(ours, theirs)
            continue
        # another libm, and sums in another order: some roundings
        few = 1e-13 if theirs.dtype == np.float64 else 1e-5
        assert_allclose(ours, theirs, rtol=few, atol=1e-14)
        zero = (ours == 0.0) & (theirs == 0.0)
        assert_array_equal(np.signbit(ours[zero]), np.signbit(theirs[zero]))


@needs_compiler
def test_awkward_numbers_come_back_from_their_literals(tmp_path):
    awkward = np.concatenate([
        REALS, [5e-324, -5e-324, 2.2250738585072014e-308, np.finfo(float).max, 0.1, 1.0 / 3.0],
        np.random.default_rng(1).integers(0, 2**63, 200).view(float),
    ])  # fmt: skip
    awkward = awkward[~np.isnan(awkward) | (np.arange(len(awkward)) < 20)]
    made = function_source(lambda k: jnp.asarray(awkward)[k], np.int32(0), name="awkward")
    call = compile_function(made, tmp_path, flags=STRICT)
    found = np.array([call(np.int32(k)) for k in range(len(awkward))])
    assert_array_equal(found, awkward)
    assert_array_equal(np.signbit(found), np.signbit(awkward))


@pytest.mark.parametrize(("value", "text"), [
    (1.0, "1.0"), (-0.0, "-0.0"), (0.1, "0.10000000000000001"), (np.inf, "INFINITY"),
    (-np.inf, "-INFINITY"), (np.nan, "NAN"), (1e300, "1.0000000000000001e+300"),
])  # fmt: skip
def test_literals_have_17_digits(value, text):
    assert literal(value, np.float64, Precision()) == text


def test_in_single_precision_a_constant_is_rounded_once():
    assert literal(0.1, np.float64, Precision("single")) == "0.10000000149011612f"
    assert literal(1e300, np.float64, Precision("single")) == "INFINITY"
    assert literal(1e-300, np.float64, Precision("single")) == "0.0f"


def test_nothing_is_folded_that_would_change_a_value():
    x = operation("neg", np.float64, constant(3.0, np.float64))
    assert x.value == -3.0
    from contourlab.export.expressions import name

    x, zero = name("x", np.float64), constant(0.0, np.float64)
    assert operation("mul", np.float64, x, zero).op == "mul"  # x may be NaN
    assert operation("add", np.float64, x, zero).op == "add"  # x may be -0
    assert operation("add", np.float64, x, constant(-0.0, np.float64)) is x
    assert operation("mul", np.float64, x, constant(1.0, np.float64)) is x


def test_a_primitive_that_cannot_be_exported_is_named_with_its_line():
    with pytest.raises(ExportError, match=r"primitive lu cannot .* test_primitives\.py:\d+"):
        function_source(lambda a: jnp.linalg.solve(a, a[0]), np.eye(3))
    with pytest.raises(ExportError, match=r"test_primitives\.py:\d+"):
        function_source(lambda k: jax.random.uniform(jax.random.key(k)), np.int32(1))


def test_a_while_loop_without_a_bound_is_refused_with_its_line():
    def halved(x):
        return lax.while_loop(lambda x: x > 1.0, lambda x: 0.5 * x, x)

    with pytest.raises(ExportError, match=r"test_primitives\.py:\d+ has no bound .*count < limit"):
        function_source(halved, np.float64(3.0))


@pytest.mark.parametrize(("start", "test", "step", "passes"), [
    (0, lambda k, n: k < n, 1, 7), (0, lambda k, n: k < n, 3, 3), (0, lambda k, n: n > k, 2, 4),
    (0, lambda k, n: k <= n, 1, 8), (9, lambda k, n: k > n, -1, 2), (7, lambda k, n: k >= n, -1, 1),
    (8, lambda k, n: k < n, 1, 0),
])  # fmt: skip
def test_the_bound_of_a_counted_loop(start, test, step, passes):
    """The bound is exact where start and limit are numbers; the flag may end it earlier."""

    def counted(x):
        return lax.while_loop(
            lambda s: (s[0] < 1e9) & test(s[1], 7), lambda s: (s[0] + 1.0, s[1] + step),
            (x, start),
        )[0]  # fmt: skip

    source = function_source(counted, np.float64(0.0)).source
    assert f"< {passes}; ++i" in source
    assert float(jax.jit(counted)(0.0)) == passes


def test_a_limit_may_be_known_by_its_clipping_only():
    def walk(at, table):
        k = jnp.clip(at, 0, 4)
        return lax.while_loop(lambda k: (k > 0) & (table[k] > 0.0), lambda k: k - 1, k)

    assert "< 4; ++i" in function_source(walk, np.int32(3), np.ones(5)).source


def test_what_moves_away_from_its_limit_has_no_bound():
    with pytest.raises(ExportError, match="no bound"):
        function_source(
            lambda x: lax.while_loop(
                lambda s: (s[0] < 9.0) & (s[1] < 5), lambda s: (s[0] + 1, s[1] - 1), (x, 0)
            ),
            np.float64(0.0),
        )


def test_the_table_of_primitives_is_all_tried():
    """Each primitive that is said to be exported occurs in one of the functions at least."""
    from contourlab.export.flatten import Program, flatten

    def names(program):
        for equation in program.equations:
            yield equation.primitive
            for value in equation.params.values():
                for one in value if isinstance(value, tuple) else (value,):
                    if isinstance(one, Program):
                        yield from names(one)

    found = set()
    for function, arguments in FUNCTIONS.values():
        found |= set(names(flatten(jax.make_jaxpr(function)(*arguments))))
    # other spellings of what is tried, in other versions of JAX
    spellings = {name for name in HANDLERS if name.replace("-", "_") != name or "scatter_" in name}
    never_made = {"add_any", "expand_dims", "reduce_xor", "cummin", "scatter-sub", "le_to"}
    assert set(HANDLERS) - found - spellings <= never_made
