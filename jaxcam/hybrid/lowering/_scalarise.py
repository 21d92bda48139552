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

from ._jaxprs import has_saving_rule, opened
from ._known import computed, is_known, join_known
from ._sincos import sincos


# operations that only move elements; the permutation is found by moving indices
_MOVES = frozenset(
    {
        "reshape",
        "squeeze",
        "transpose",
        "broadcast_in_dim",
        "slice",
        "rev",
        "expand_dims",
        "gather",
        "dynamic_slice",
        "copy",
    }
)
_ELEMENTWISE = frozenset(
    """
    abs acos acosh add add_any and asin asinh atan atan2 atanh cbrt ceil clamp
    convert_element_type cos cosh digamma div eq erf exp exp2 expm1 floor ge gt
    integer_pow is_finite le lgamma log log1p logistic lt max min mul ne neg nextafter
    not or pow rem round rsqrt select_n sign sin sinh sqrt square sub tan tanh xor
    """.split()
)
_SUMS = {"reduce_sum": jnp.add, "reduce_max": jnp.maximum, "reduce_min": jnp.minimum}


def split(array) -> np.ndarray:
    """Return an array as a numpy array of scalars."""
    shape = jnp.shape(array)
    out = np.empty(shape, dtype=object)
    for index in np.ndindex(shape):
        # a zero-dimensional numpy array becomes a number, which counts as known
        whole = not shape and not isinstance(array, np.ndarray)
        out[index] = array if whole else array[index]
    return out


def join(elements: np.ndarray):
    """Return the inverse of `split`."""
    if elements.shape == ():
        return jnp.asarray(elements[()])
    flat = [jnp.asarray(e) for e in elements.ravel()]
    return jnp.stack(flat).reshape(elements.shape)


def joined(function: Callable) -> Callable:
    """Convert a `function` of arrays to split arrays, by joining its arguments."""

    def call(*arguments):
        return jax.tree.map(split, function(*(join(_boxed(a)) for a in arguments)))

    return call


def scalarise(function: Callable, *example) -> Callable:
    """Evaluate `function` on split arguments and return split results.

    **Arguments:** the function of arrays, and examples of its arguments (pytrees of
    arrays or `jax.ShapeDtypeStruct`).

    Returns:
        A function of the same pytrees with split arrays as leaves.
    """
    closed, shape = jax.make_jaxpr(function, return_shape=True)(*example)
    treedef = jax.tree.structure(shape)

    def call(*arguments, memory: dict | None = None):
        leaves = [_boxed(leaf) for leaf in jax.tree.leaves(arguments)]
        consts = _constants(closed.consts)
        memory = {} if memory is None else memory
        outputs = _evaluate(closed.jaxpr, consts, leaves, memory)
        return jax.tree.unflatten(treedef, outputs)

    return call


def _constants(values) -> list[np.ndarray]:
    """Return the constants of a jaxpr; those with known values become numbers."""
    return [split(v if isinstance(v, Tracer) else np.asarray(v)) for v in values]


def _boxed(leaf) -> np.ndarray:
    if isinstance(leaf, np.ndarray) and leaf.dtype == object:
        return leaf
    out = np.empty((), dtype=object)
    out[()] = leaf
    return out


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
    # a rule for reverse mode only contains only the body
    if has_saving_rule(equation) or name == "custom_vjp_call":
        inside = params["call_jaxpr"].jaxpr, params["call_jaxpr"].consts
    else:
        inside = opened(equation)
    if inside is not None:
        return _evaluate(inside[0], _constants(inside[1]), inputs, memory)
    outputs = [v.aval for v in equation.outvars]
    if name in _MOVES and all(is_known(e) for i in inputs[1:] for e in i.ravel()):
        return [_move(equation, inputs)]
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
        return [_reduce(_SUMS[name], inputs[0], params["axes"], outputs[0].shape)]
    if name == "dot_general" and _plain_product(params):
        return [_product(inputs, params)]
    if name in _ELEMENTWISE:
        return [_elementwise(equation, inputs, outputs[0].shape, memory)]
    # a user-defined rule, such as a custom derivative, is among these parameters
    params = equation.primitive.get_bind_params(params)
    made = equation.primitive.bind(*[join(i) for i in inputs], **params)
    made = made if equation.primitive.multiple_results else [made]
    return [split(m) for m in made]


def _move(equation, inputs):
    """Find the destination of each element by applying the operation to indices."""
    first, others = inputs[0], [join_known(i) for i in inputs[1:]]
    name, params = equation.primitive.name, equation.params
    if name in ("reshape", "squeeze"):
        return first.reshape(equation.outvars[0].aval.shape)
    if name == "slice":
        strides = params["strides"] or (1,) * first.ndim
        cuts = zip(params["start_indices"], params["limit_indices"], strides)
        return first[tuple(slice(*c) for c in cuts)]
    if name == "transpose":
        return first.transpose(params["permutation"])
    if name == "broadcast_in_dim":
        shape, kept = params["shape"], params["broadcast_dimensions"]
        sizes = [1] * len(shape)
        for axis, dimension in enumerate(kept):
            sizes[dimension] = first.shape[axis]
        return np.broadcast_to(first.reshape(sizes), shape).copy()
    indices = np.arange(first.size, dtype=np.int64).reshape(first.shape)
    with jax.ensure_compile_time_eval():
        target = np.asarray(
            equation.primitive.bind(*map(jnp.asarray, (indices, *others)), **params)
        )
    if target.size and (target.min() < 0 or target.max() >= first.size):
        # a gather with a fill value outside the range
        return split(equation.primitive.bind(join(first), *others, **params))
    out = np.empty(target.shape, dtype=object)
    out.ravel()[:] = first.ravel()[target.ravel()]
    return out


def _reduce(operation, elements, axes, shape):
    moved = np.moveaxis(elements, axes, range(len(axes)))
    moved = moved.reshape((-1,) + tuple(shape))
    out = np.empty(shape, dtype=object)
    for index in np.ndindex(tuple(shape)):
        column = moved[(slice(None),) + index]
        total = column[0]
        for e in column[1:]:
            total = operation(total, e)
        out[index] = total
    return out


def _plain_product(params) -> bool:
    (left, right), (batch_left, batch_right) = params["dimension_numbers"]
    return len(left) == 1 and not batch_left and not batch_right


def _product(inputs, params):
    ((left,), (right,)), _ = params["dimension_numbers"]
    a = np.moveaxis(inputs[0], left, -1)
    b = np.moveaxis(inputs[1], right, 0)
    out = np.empty(a.shape[:-1] + b.shape[1:], dtype=object)
    for i in np.ndindex(a.shape[:-1]):
        for k in np.ndindex(b.shape[1:]):
            terms = [x * b[(n,) + k] for n, x in enumerate(a[i])]
            total = terms[0]
            for term in terms[1:]:
                total = total + term
            out[i + k] = total
    return out


def _elementwise(equation, inputs, shape, memory):
    columns = [
        (i if i.shape == shape else np.broadcast_to(i, shape)).ravel() for i in inputs
    ]
    out = np.empty(shape, dtype=object)
    flat = out.ravel()
    for k, scalars in enumerate(zip(*columns, strict=True)):
        flat[k] = _scalar(equation, scalars, memory)
    return out


def _scalar(equation, scalars, memory):
    """Evaluate an operation on scalars, once for the same operands."""
    name, params = equation.primitive.name, equation.params
    if name == "convert_element_type":
        kind = params["new_dtype"]
        if not is_known(scalars[0]) and scalars[0].dtype == kind:
            return scalars[0]
    shortcut = _identity(name, scalars)
    if shortcut is not None:
        return shortcut
    operands = tuple(
        ("known", s.item() if isinstance(s, np.generic) else s, str(np.result_type(s)))
        if is_known(s)
        else id(s)
        for s in scalars
    )
    turn = name in ("sin", "cos", "tan") and equation.outvars[0].aval.dtype == "float64"
    key = ("sincos" if turn else name, str(params), operands)
    if key not in memory:
        arrays = [jnp.asarray(s) for s in scalars]
        made = sincos(arrays[0]) if turn else equation.primitive.bind(*arrays, **params)
        # the operands are kept, so that their identities are not reused
        memory[key] = (made, scalars)
    made = memory[key][0]
    if not turn:
        return made
    sine, cosine = made
    return sine if name == "sin" else cosine if name == "cos" else sine / cosine


def _identity(name, scalars):
    """Simplify sums with zero and products with zero or one, which differentiation
    leaves.
    """
    if len(scalars) != 2 or name not in ("add", "add_any", "sub", "mul"):
        return None
    a, b = scalars
    if name == "mul":
        for known, other in ((a, b), (b, a)):
            if is_known(known) and isinstance(known, np.floating):
                if known == 1.0:
                    return other
                if known == 0.0:
                    return known
        return None
    if is_known(b) and isinstance(b, np.floating) and b == 0.0:
        return a
    if name != "sub" and is_known(a) and isinstance(a, np.floating) and a == 0.0:
        return b
    return None
