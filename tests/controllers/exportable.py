"""Which steps of a compiled law have a counterpart in allocation-free C."""

import numpy as np

ELEMENTWISE = {
    "abs", "add", "add_any", "and", "atan2", "ceil", "clamp", "convert_element_type", "copy",
    "copy_p", "cos", "cosh", "div", "eq", "exp", "expm1", "floor", "ge", "gt", "integer_pow",
    "is_finite", "le", "le_to", "log", "log1p", "logistic", "lt", "lt_to", "max", "min", "mul",
    "ne", "neg", "not",
    "or", "pow", "rem", "round", "rsqrt", "select_n", "sign", "sin", "sinh", "sqrt", "square",
    "stop_gradient", "sub", "tan", "tanh", "xor", "cbrt",
}  # fmt: skip
SHAPES = {
    "broadcast_in_dim", "concatenate", "dynamic_slice", "dynamic_update_slice", "expand_dims",
    "gather", "iota", "pad", "reshape", "rev", "scatter", "scatter-add", "scatter_add", "slice",
    "squeeze", "stack", "transpose", "split",
}  # fmt: skip
SUMS = {
    "argmax", "argmin", "dot_general", "reduce_and", "reduce_max", "reduce_min", "reduce_or",
    "reduce_sum", "reduce_prod", "cumsum",
}  # fmt: skip
CALLS = {"pjit", "jit", "closed_call", "custom_jvp_call", "custom_vjp_call", "core_call"}
LOOPS = {"scan", "while", "cond"}


def inner(value):
    """Jaxprs in the parameters of an equation."""
    if hasattr(value, "eqns"):
        yield value
    elif hasattr(value, "jaxpr"):
        yield from inner(value.jaxpr)
    elif isinstance(value, tuple | list):
        for one in value:
            yield from inner(one)


def equations(jaxpr):
    """All equations, those of loops and calls too."""
    for equation in jaxpr.eqns:
        yield equation
        for name, value in equation.params.items():
            if name not in ("jvp_jaxpr_fun", "jvp_jaxpr_thunk", "fwd_jaxpr_thunk"):
                for below in inner(value):
                    yield from equations(below)


def counts(equation):
    """Whether a while loop goes on only as long as a whole number is on one side of another."""
    return any(
        below.primitive.name in ("lt", "gt", "le", "ge")
        and all(np.issubdtype(v.aval.dtype, np.integer) for v in below.invars)
        for condition in inner(equation.params["cond_jaxpr"])
        for below in equations(condition)
    )


def refuse_what_c_has_not(closed):
    """Assert that every equation is of a kind that the export can write."""
    names = set()
    for equation in equations(closed.jaxpr):
        name = equation.primitive.name
        names.add(name)
        if name == "while":
            assert counts(equation), "a while loop without a count"
    unknown = names - ELEMENTWISE - SHAPES - SUMS - CALLS - LOOPS
    assert not unknown, f"no counterpart in C: {sorted(unknown)}"
