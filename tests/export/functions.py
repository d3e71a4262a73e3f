"""Small functions, one or more for each primitive that can be exported, and arguments for them.

The numbers are awkward: signed zeros, NaN, infinities, the ends of whole types, places outside of
arrays. No denormals: JAX takes them for 0 on a processor, C does not.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

RANDOM = np.random.default_rng(0)
REALS = np.array([
    0.0, -0.0, 1.5, -2.5, np.nan, np.inf, -np.inf, 3e-300, 1e308, 0.5, -0.5, 2.5, 3.5, 1e20, -1e20,
    2147483647.0, 2147483648.5, -2147483649.0, 1e300, -1e-299,
])  # fmt: skip
OTHERS = np.roll(REALS, 3)
WHOLE = np.array([2**31 - 1, -(2**31), 5, -5, 0, 7, -7, 1], np.int32)
AGAINST = np.array([1, -1, 0, 2, 0, -2, 3, -(2**31)], np.int32)
LONG, LONG_AGAINST = WHOLE.astype(np.int64) * 2**31, AGAINST.astype(np.int64)
TRUE, FALSE = np.array([True, False, True, False]), np.array([True, True, False, False])
PLACES = np.array([0, 5, 1, -1, 1, 100, -100], np.int32)


def reals(*shape):
    return RANDOM.normal(size=shape)


def elementwise():
    found = {}
    for op in ("max", "min", "add", "sub", "mul", "div", "rem", "atan2", "nextafter", "pow"):
        found[op] = getattr(lax, op), (REALS, OTHERS)
    for op in (
        "abs", "neg", "sign", "sqrt", "floor", "ceil", "exp", "sin", "cos", "tan", "tanh", "log",
        "log1p", "expm1", "cbrt", "asin", "acos", "atan", "sinh", "cosh", "asinh", "acosh",
        "atanh", "is_finite", "square", "rsqrt", "logistic", "erf", "erfc", "exp2", "lgamma",
    ):  # fmt: skip
        found[f"{op}_real"] = getattr(lax, op), (REALS,)
    even, away = lax.RoundingMethod.TO_NEAREST_EVEN, lax.RoundingMethod.AWAY_FROM_ZERO
    found["round_even"] = (lambda x: lax.round(x, even)), (REALS,)
    found["round_away"] = (lambda x: lax.round(x, away)), (REALS,)
    for k in (-3, -1, 0, 1, 2, 3, 7):
        found[f"integer_pow_{k + 3}"] = (lambda x, k=k: lax.integer_pow(x, k)), (REALS,)
    for op in ("lt", "le", "gt", "ge", "eq", "ne"):
        found[f"{op}_real"] = getattr(lax, op), (REALS, OTHERS)
        found[f"{op}_whole"] = getattr(lax, op), (WHOLE, AGAINST)
    for op in (
        "max", "min", "add", "sub", "mul", "div", "rem", "bitwise_and", "bitwise_or",
        "bitwise_xor", "shift_left", "shift_right_logical", "shift_right_arithmetic",
    ):  # fmt: skip
        found[f"{op}_whole"] = getattr(lax, op), (WHOLE, AGAINST)
    for op in ("add", "sub", "mul", "div", "rem", "shift_left", "shift_right_logical"):
        unsigned = WHOLE.view(np.uint32), AGAINST.view(np.uint32)
        found[f"{op}_unsigned"] = getattr(lax, op), unsigned
    for op in ("add", "sub", "mul", "div", "rem"):
        found[f"{op}_long"] = getattr(lax, op), (LONG, LONG_AGAINST)
    for op in ("abs", "neg", "sign", "bitwise_not"):
        found[f"{op}_whole"] = getattr(lax, op), (WHOLE,)
    for op in ("bitwise_and", "bitwise_or", "bitwise_xor"):
        found[f"{op}_truth"] = getattr(lax, op), (TRUE, FALSE)
    found["not_truth"] = lax.bitwise_not, (TRUE,)
    for kind in ("int32", "int64", "uint32", "int8", "uint8", "bool", "float32"):
        found[f"real_to_{kind}"] = (lambda x, kind=kind: x.astype(kind)), (REALS,)
    for kind in ("float64", "int8", "uint32", "bool", "int64"):
        found[f"whole_to_{kind}"] = (lambda x, kind=kind: x.astype(kind)), (WHOLE,)
    found["truth_to_real"] = (lambda x: x.astype(float) * 2.0), (TRUE,)
    found["clamp"] = (lambda x: lax.clamp(-1.0, x, 1.0)), (REALS,)
    cases = (np.array([0, 1, 2], np.int32), reals(3), reals(3), reals(3))
    found["select_several"] = (lambda w, *c: lax.select_n(w, *c)), cases
    found["copysign"] = jnp.copysign, (REALS, OTHERS)
    found["mod"] = jnp.mod, (REALS, OTHERS)
    found["floor_divide"] = jnp.floor_divide, (WHOLE, np.where(AGAINST == 0, 3, AGAINST))
    found["single"] = (
        lambda x: (x.astype(jnp.float32) * np.float32(0.1) + jnp.sin(x.astype(jnp.float32)))
    ), (reals(9),)  # fmt: skip
    found["constants"] = (lambda x: x + jnp.asarray(REALS)[:, None]), (reals(20, 1),)
    found["table"] = (lambda k: jnp.asarray(REALS)[k]), (PLACES,)
    found["total_order"] = (lambda x: jnp.searchsorted(jnp.linspace(-2.0, 2.0, 9), x)), (REALS,)
    return found


def arrays(x, y):
    """Of two arrays of one shape, at least (2, 3)."""
    wide = np.asarray(PLACES)
    found = {
        "transpose": (lambda x: x.T, (x,)),
        "reverse": (lambda x: x[::-1, ::-1], (x,)),
        "slice": (lambda x: x[1:, ::2], (x,)),
        "reshape": (lambda x: (x * 2).reshape(-1) + 1, (x,)),
        "reshape_moved": (lambda x: (x.T * 2).reshape(x.shape) + x, (x,)),
        "concatenate": (lambda x, y: jnp.concatenate([x * 2, y, x], 1), (x, y)),
        "stack": (lambda x, y: jnp.stack([x, y], 1), (x, y)),
        "pad": (lambda x: lax.pad(x, 0.5, ((1, 2, 1), (-1, 2, 0))), (x,)),
        "pad_away": (lambda x: lax.pad(x, 0.5, ((-1, -1, 0), (1, -1, 2))), (x,)),
        "split": (lambda x: jnp.split(x, [1], axis=1), (x,)),
        "iota": (lambda x: x + lax.broadcasted_iota(float, x.shape, 1), (x,)),
        "any": (lambda x: jnp.any(x > 1, axis=0), (x,)),
        "all": (lambda x: jnp.all(x > -1, axis=1), (x,)),
        "argmax": (lambda x: jnp.argmax(x, axis=1), (x,)),
        "argmin": (lambda x: jnp.argmin(x, axis=0), (x,)),
        "cumsum": (lambda x: jnp.cumsum(x, axis=1), (x,)),
        "cumsum_back": (lambda x: lax.cumsum(x, axis=1, reverse=True), (x,)),
        "cumprod": (lambda x: jnp.cumprod(x, axis=0), (x,)),
        "cummax_back": (lambda x: lax.cummax(x, axis=0, reverse=True), (x,)),
        "matrix_matrix": (lambda x, y: x @ y.T, (x, y)),
        "matrix_turned": (lambda x, y: x.T @ y, (x, y)),
        "matrix_vector": (lambda x, y: x @ y[0], (x, y)),
        "vector_matrix": (lambda x, y: y[:, 0] @ x, (x, y)),
        "batched": (lambda x, y: jnp.einsum("ij,ik->ijk", x, y), (x, y)),
        "batched_sum": (lambda x, y: jnp.einsum("ij,ij->j", x, y), (x, y)),
        "broadcast": (lambda x: x[:, None, :] * jnp.exp(x)[:, :, None], (x,)),
        "used_often": (lambda x: (lambda e: e + e.sum() + e[0])(jnp.exp(x)), (x,)),
        "gather": (lambda x, k: x[k], (x, wide)),
        "gather_columns": (lambda x, k: x[:, k], (x, wide)),
        "take": (lambda x, k: jnp.take(x, k, axis=0), (x, wide)),
        "gather_whole": (
            lambda x, k: (x * 10).astype(jnp.int32).at[k].get(mode="fill"), (x, wide)),
        "gather_truth": (lambda x, k: (x > 0).at[k].get(mode="fill"), (x, wide)),
        "scatter_add": (lambda x, k: x.at[k].add(1.5), (x, wide)),
        "scatter_columns": (lambda x, k: x.at[:, k].set(1.5), (x, wide)),
        "scatter_mul": (lambda x, k: x.at[k, 0].mul(1.5), (x, wide)),
        "scatter_max": (lambda x, k: x.at[k, 0].max(0.5), (x, wide)),
        "scatter_min": (lambda x, k: x.at[k, 0].min(-0.5), (x, wide)),
        "sort": (lambda x: jnp.sort(x.ravel()), (x,)),
        "argsort": (lambda x: jnp.argsort(x[0]), (x,)),
        "roll": (lambda x: jnp.roll(x, 2, axis=1), (x,)),
        "scan": (
            lambda x: lax.scan(
                lambda c, r: (c * 0.5 + r, (c.sum(), r * c)), jnp.zeros(x.shape[1]), x),
            (x,)),
        "scan_back": (
            lambda x: lax.scan(
                lambda c, r: (c * 0.5 + r, c), jnp.zeros(x.shape[1]), x, reverse=True),
            (x,)),
        "scan_of_arrays": (
            lambda x: lax.scan(lambda c, r: (c.at[0].set(r) + c[::-1], c * r), x, x), (x,)),
        "carries_that_change_places": (
            lambda x: lax.fori_loop(0, 3, lambda k, ab: (ab[1], ab[0] + 1), (x, x * 2)), (x,)),
        "scalars_that_change_places": (
            lambda x: lax.fori_loop(0, 3, lambda k, ab: (ab[1], ab[0]), (x[0, 0], x[0, 1])),
            (x,)),
        "while": (
            lambda x: lax.while_loop(
                lambda s: (s[0].sum() < 50) & (s[1] < 20),
                lambda s: (s[0] * 1.3 + jnp.abs(s[0]), s[1] + 1), (jnp.abs(x), 0)),
            (x,)),
        "cond": (
            lambda x: lax.cond(
                x[0, 0] > 0, lambda x: (x * 2, x.sum()), lambda x: (x + 1, x[0, 0]), x),
            (x,)),
        "cond_otherwise": (
            lambda x: lax.cond(
                x[0, 0] <= 0, lambda x: (x * 2, x.sum()), lambda x: (x + 1, x[0, 0]), x),
            (x,)),
        "cross": (lambda x: jnp.cross(x[0, :3], x[1, :3]), (x,)),
        "interp": (lambda x: jnp.interp(x, jnp.linspace(-2, 2, 9), jnp.arange(9.0) ** 2), (x,)),
        "gradient": (jax.grad(lambda x: jnp.sum(jnp.tanh(x) @ x.T)), (x,)),
        "gather_rows_apart": (
            lambda x, k: jax.vmap(lambda r, k: lax.dynamic_slice(r, (k,), (2,)))(x, k),
            (x, np.arange(len(x), dtype=np.int32) - 1)),
    }  # fmt: skip
    for op in ("sum", "max", "min", "prod"):
        for axis in (0, 1, None):
            found[f"{op}_{axis}"] = (
                (lambda x, op=op, axis=axis: getattr(jnp, op)(x * 1.5, axis=axis)), (x,)
            )  # fmt: skip
    for k in (-3, -1, 0, 1, 9):
        at, name = np.int32(k), k + 3
        found |= {
            f"slice_at_{name}": (lambda x, k: lax.dynamic_slice(x, (k, k), (2, 2)), (x, at)),
            f"update_at_{name}": (
                lambda x, k: lax.dynamic_update_slice(x, jnp.ones((2, 1)), (k, k)), (x, at)),
            f"row_{name}": (lambda x, k: x[k], (x, at)),
            f"set_{name}": (lambda x, k: x.at[k].set(7.0), (x, at)),
            f"add_{name}": (lambda x, k: x.at[k, 1].add(7.0), (x, at)),
            f"drop_{name}": (lambda x, k: x.at[k].set(7.0, mode="drop"), (x, at)),
            f"clip_{name}": (lambda x, k: x.at[k].set(7.0, mode="clip"), (x, at)),
            f"fill_{name}": (lambda x, k: x.at[k].get(mode="fill"), (x, at)),
            f"switch_{name}": (
                lambda x, k: lax.switch(k, [jnp.abs, lambda x: x * 2, jnp.exp], x), (x, at)),
        }  # fmt: skip
    return found


def everything():
    """Return every function by name, with its arguments."""
    found = dict(elementwise())
    for size, shape in (("small", (2, 3)), ("large", (5, 7))):
        own = arrays(reals(*shape), reals(*shape))
        found |= {f"{name}_{size}": one for name, one in own.items()}
    return found | {
        "argmax_nan": (jnp.argmax, (REALS,)), "argmin_nan": (jnp.argmin, (REALS,)),
        "sort_nan": (jnp.sort, (REALS,)), "min_nan": (jnp.min, (REALS,)),
        "median": (jnp.median, (reals(9),)), "outer": (jnp.outer, (reals(4), reals(5))),
        "lower": (jnp.tril, (reals(5, 5),)), "diagonal": (jnp.diag, (reals(5),)),
        "long_sum": (lambda x: jnp.sum(jnp.exp(x)), (reals(40, 50),)),
        "large_product": (lambda x: x @ x.T, (reals(30, 20),)),
        "batch_of_products": (
            lambda x, y: jnp.einsum("bij,bjk->bik", x, y), (reals(4, 3, 5), reals(4, 5, 6))),
        "batch_of_sums": (lambda x, y: jnp.einsum("bi,bi->b", x, y), (reals(4, 3), reals(4, 3))),
        "long_vector": (lambda x, y: x @ y, (reals(40), reals(40))),
    }  # fmt: skip
