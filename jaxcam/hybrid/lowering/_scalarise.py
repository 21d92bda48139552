"""Rewrite a function of small arrays as arithmetic on scalars.

If a state of two numbers is an array of length two, every operation of a batch is a
pass over interleaved memory. Here, a function is traced once and evaluated with one
scalar for each array element, so that under `vmap` every operation is a plain
elementwise operation over the batch, which the compiler fuses into one kernel. Sine,
cosine and tangent are replaced by arithmetic (see `_sincos.py`).

An operation that cannot be split keeps its array form, which is slower but never wrong.
"""

from collections.abc import Callable
from typing import no_type_check

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.extend.core import Literal

from ._elements import boxed, join, join_traced, LONG, split as split, traced
from ._jaxprs import has_saving_rule, opened, without_unused
from ._known import computed, is_known, join_known
from ._moves import moved, MOVES
from ._scalars import Memory, once
from ._scatter import COMBINED, scattered
from ._sincos import sincos
from ._taylor import by_nested_derivatives, coefficient, has_series, in_series, Series


_ELEMENTWISE = frozenset(
    """
    abs acos acosh add add_any and asin asinh atan atan2 atanh cbrt ceil clamp
    convert_element_type cos cosh digamma div eq erf exp exp2 expm1 floor ge gt
    integer_pow is_finite le lgamma log log1p logistic lt max min mul ne neg nextafter
    not or pow rem round rsqrt select_n sign sin sinh sqrt square sub tan tanh xor
    """.split()
)
_SUMS = {
    "reduce_sum": jax.lax.add_p,
    "reduce_max": jax.lax.max_p,
    "reduce_min": jax.lax.min_p,
}


_TURNS = frozenset({"sin", "cos", "tan"})
# primitives that the rules for series and scatters use
_PRIMITIVES = {
    "add": jax.lax.add_p,
    "add_any": jax.lax.add_p,
    "sub": jax.lax.sub_p,
    "mul": jax.lax.mul_p,
    "div": jax.lax.div_p,
    "neg": jax.lax.neg_p,
    "sign": jax.lax.sign_p,
    "ge": jax.lax.ge_p,
    "select_n": jax.lax.select_n_p,
    "max": jax.lax.max_p,
    "min": jax.lax.min_p,
}


class SplitProgram:
    """A traced function whose arguments are arrays of scalars, made by `split`."""

    def __init__(self, call: Callable, *programs):
        self._call = call
        constants = [value for program in programs for value in program.consts]
        # whether no constant is a value of the trace in which the program was made
        self.portable = not any(isinstance(value, Tracer) for value in constants)

    def __call__(self, *arguments, memory: Memory | None = None):
        return self._call(*arguments, memory=Memory() if memory is None else memory)


def joined(function: Callable) -> Callable:
    """Convert a `function` of arrays to one of split arrays, by joining arguments."""

    def call(*arguments):
        return jax.tree.map(split, function(*(join(boxed(a)) for a in arguments)))

    return call


def scalarise(function: Callable, *example) -> SplitProgram:
    """Return a `function` of arrays as a program with split arguments and results.

    **Arguments:** the function of arrays, and examples of its arguments (pytrees of
    arrays or `jax.ShapeDtypeStruct`).

    Returns:
        A function of the same pytrees with split arrays as leaves.
    """
    closed, shape = jax.make_jaxpr(function, return_shape=True)(*example)
    closed = without_unused(closed)
    treedef = jax.tree.structure(shape)

    def call(*arguments, memory: Memory):
        outputs = evaluated(closed, jax.tree.leaves(arguments), memory)
        return jax.tree.unflatten(treedef, [traced(o, memory) for o in outputs])

    return SplitProgram(call, closed)


def evaluated(closed, leaves, memory: Memory) -> list[np.ndarray]:
    """Return the results, which are not traced yet, of a program of arrays for split
    arguments.
    """
    arguments = [boxed(leaf) for leaf in leaves]
    return _evaluate(closed.jaxpr, _constants(closed.consts), arguments, memory)


def _constants(values) -> list[np.ndarray]:
    """Return the constants of a jaxpr; those with known values become numbers."""
    return [split(v if isinstance(v, Tracer) else np.asarray(v)) for v in values]


# called for every equation; see `_jaxprs.py`
@no_type_check
def _evaluate(jaxpr, consts, arguments, memory):
    values = {}

    def read(v):
        return split(np.asarray(v.val)) if isinstance(v, Literal) else values[v]

    values.update(zip(jaxpr.constvars, consts, strict=True))
    values.update(zip(jaxpr.invars, arguments, strict=True))
    for equation in jaxpr.eqns:
        inputs = [read(v) for v in equation.invars]
        outputs = _apply(equation, inputs, memory)
        values.update(zip(equation.outvars, outputs, strict=True))
    return [read(v) for v in jaxpr.outvars]


@no_type_check
def _apply(equation, inputs, memory):
    name = equation.primitive.name
    params = equation.params
    # a call is replaced by its body if its derivative rule only saves work, or is for
    # reverse mode only
    if has_saving_rule(equation) or name == "custom_vjp_call":
        inside = params["call_jaxpr"].jaxpr, params["call_jaxpr"].consts
    else:
        inside = opened(equation)
    if inside is not None:
        return _evaluate(inside[0], _constants(inside[1]), inputs, memory)
    outputs = [v.aval for v in equation.outvars]
    if name in MOVES and all(is_known(e) for i in inputs[1:] for e in i.ravel()):
        return [moved(equation, inputs, memory)]
    if name == "concatenate":
        return [np.concatenate(inputs, axis=params["dimension"])]
    if name == "stack":
        return [np.stack(inputs, axis=params["axis"])]
    if name == "split":
        cuts = np.cumsum(params["sizes"])[:-1]
        return list(np.split(inputs[0], cuts, axis=params["axis"]))
    if all(is_known(e) for i in inputs for e in i.ravel()):
        return [split(a) for a in computed(equation, [join_known(i) for i in inputs])]
    if name in _SUMS:
        operation = _SUMS[name]
        return [_reduce(operation, inputs[0], params["axes"], outputs[0].shape, memory)]
    if name == "dot_general" and _plain_product(params):
        return [_product(inputs, params, memory)]
    if name in _ELEMENTWISE:
        return [_elementwise(equation, inputs, outputs[0].shape, memory)]
    if name == "scatter" or name in COMBINED:
        made = _scattered(equation, inputs, memory)
        if made is not None:
            return [made]
    if any(has_series(i.ravel()) for i in inputs):
        return _by_derivatives(equation, inputs, memory)
    # these parameters include a user-defined rule, such as a custom derivative
    params = equation.primitive.get_bind_params(params)
    made = equation.primitive.bind(*[join_traced(i, memory) for i in inputs], **params)
    made = made if equation.primitive.multiple_results else [made]
    return [split(m) for m in made]


@no_type_check
def _scattered(equation, inputs, memory):
    """Return the elements after a scatter at known indices into a short array;
    otherwise `None`.
    """
    short = inputs[0].size <= LONG
    if not short or not all(is_known(e) for e in inputs[1].ravel()):
        return None

    def combine(name, old, new):
        return _binary(_PRIMITIVES[name], old, new, memory)

    return scattered(combine, equation, inputs)


def _reduce(operation, elements, axes, shape, memory):
    first = np.moveaxis(elements, axes, range(len(axes)))
    first = first.reshape((-1,) + tuple(shape))
    out = np.empty(shape, dtype=object)
    for index in np.ndindex(tuple(shape)):
        column = first[(slice(None),) + index]
        total = column[0]
        for e in column[1:]:
            total = _binary(operation, total, e, memory)
        out[index] = total
    return out


def _plain_product(params) -> bool:
    (left, right), (batch_left, batch_right) = params["dimension_numbers"]
    return len(left) == 1 and not batch_left and not batch_right


def _product(inputs, params, memory):
    ((left,), (right,)), _ = params["dimension_numbers"]
    a = np.moveaxis(inputs[0], left, -1)
    b = np.moveaxis(inputs[1], right, 0)
    out = np.empty(a.shape[:-1] + b.shape[1:], dtype=object)
    for i in np.ndindex(a.shape[:-1]):
        for k in np.ndindex(b.shape[1:]):
            pairs = [(x, b[(n,) + k]) for n, x in enumerate(a[i])]
            terms = [_binary(jax.lax.mul_p, *pair, memory) for pair in pairs]
            total = terms[0]
            for term in terms[1:]:
                total = _binary(jax.lax.add_p, total, term, memory)
            out[i + k] = total
    return out


def _binary(primitive, a, b, memory):
    """Apply a primitive of two operands without parameters."""
    if not has_series((a, b)):
        return once(primitive, {}, (a, b), memory)
    return in_series(primitive.name, {}, (a, b), _rule_operation(None, memory))


def _elementwise(equation, inputs, shape, memory):
    columns = [
        (i if i.shape == shape else np.broadcast_to(i, shape)).ravel() for i in inputs
    ]
    out = np.empty(shape, dtype=object)
    flat = out.ravel()
    for k, scalars in enumerate(zip(*columns, strict=True)):
        flat[k] = _scalar(equation, scalars, memory)
    return out


def _scalar(equation, elements, memory):
    """Return the result of an operation on scalars, or on series."""
    name, params = equation.primitive.name, equation.params
    if has_series(elements):
        apply = _rule_operation(equation, memory)
        made = in_series(name, params, elements, apply)
        if made is not None:
            return made
        parts = [boxed(e) for e in elements]
        return _by_derivatives(equation, parts, memory)[0][()]
    dtype = equation.outvars[0].aval.dtype
    if name == "convert_element_type":
        if not is_known(elements[0]) and elements[0].dtype == dtype:
            return elements[0]
    if name in _TURNS and dtype == "float64":
        return _turn(name, elements, memory)
    return once(equation.primitive, params, elements, memory, dtype)


def _turn(name, elements, memory):
    pair = once(sincos, {}, elements, memory, np.dtype(np.float64))
    if name != "tan":
        return once(_sine if name == "sin" else _cosine, {}, (pair,), memory)
    parts = [once(part, {}, (pair,), memory) for part in (_sine, _cosine)]
    return once(jax.lax.div_p, {}, parts, memory)


def _sine(pair):
    return pair[0]


def _cosine(pair):
    return pair[1]


def _rule_operation(equation, memory):
    """Return the function that applies an operation in a rule for series."""

    def apply(name, *scalars):
        if name in _TURNS:
            return _turn(name, scalars, memory)
        if equation is not None and name == equation.primitive.name:
            dtype = equation.outvars[0].aval.dtype
            return once(equation.primitive, equation.params, scalars, memory, dtype)
        dtype = np.dtype(bool) if name == "ge" else None
        return once(_PRIMITIVES[name], {}, scalars, memory, dtype)

    return apply


def _by_derivatives(equation, inputs, memory):
    """Return the results of an operation on arrays of series, by nested derivatives."""
    order = max(
        len(e.coefficients) - 1
        for i in inputs
        for e in i.ravel()
        if isinstance(e, Series)
    )
    params = equation.primitive.get_bind_params(equation.params)

    def function(*arrays):
        made = equation.primitive.bind(*arrays, **params)
        return made if equation.primitive.multiple_results else [made]

    arguments = []
    for elements in inputs:
        if has_series(elements.ravel()):
            elements = [_part(elements, k) for k in range(order + 1)]
        arguments.append(elements)
    shapes = [
        jax.tree.map(
            lambda part, v=v: jax.ShapeDtypeStruct(part.shape, v.aval.dtype), a
        )
        for a, v in zip(arguments, equation.invars, strict=True)
    ]
    program = jax.make_jaxpr(by_nested_derivatives(function, order))(*shapes)
    made = evaluated(without_unused(program), jax.tree.leaves(arguments), memory)
    number = len(equation.outvars)
    return [
        _joined_orders(made[i::number])
        if jnp.issubdtype(v.aval.dtype, jnp.floating)
        else made[i]
        for i, v in enumerate(equation.outvars)
    ]


def _part(elements: np.ndarray, order: int) -> np.ndarray:
    out = np.empty(elements.shape, dtype=object)
    for index in np.ndindex(elements.shape):
        out[index] = coefficient(elements[index], order)
    return out


def _joined_orders(parts: list[np.ndarray]) -> np.ndarray:
    """Return an array of series from the arrays of their coefficients."""
    out = np.empty(parts[0].shape, dtype=object)
    for index in np.ndindex(out.shape):
        out[index] = Series(part[index] for part in parts)
    return out
