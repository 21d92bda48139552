"""Operations on small arrays: rearrangements, sums and products.

An array is a numpy array whose elements are numbers known while tracing (numpy) or LLVM
values.
"""

import functools
import itertools
from collections.abc import Callable
from typing import no_type_check

import jax
import jax.numpy as jnp
import numpy as np

from ..lowering import is_known, join_known, rearranged, replaces
from ._elementwise import elementwise
from ._lookup import fill_of, looked_up_in_memory
from ._writer import Lacking, Writer


# operations that only move elements if their indices are known
MOVES = frozenset(
    """
    broadcast_in_dim concatenate copy dynamic_slice dynamic_update_slice expand_dims
    gather pad rev reshape scatter slice split squeeze stack tile transpose
    """.split()
)
# maximum size of a table whose elements are selected by comparison with an unknown
# index; longer ones are read from memory
_MOST = 64


def known(elements: np.ndarray) -> bool:
    return all(is_known(e) for e in elements.ravel())


@no_type_check
def moved(equation, inputs) -> list[np.ndarray]:
    """Return the elements in the order in which an operation puts them, which is found
    by applying the operation to indices.

    Operands that are indices must be known.
    """
    simple = rearranged(equation, inputs)
    if simple is not None:
        return [simple]
    if equation.primitive.name == "scatter" and not replaces(equation):
        raise Lacking("a function applied to elements of an array")
    if equation.primitive.name == "split":
        cuts = np.cumsum(equation.params["sizes"])[:-1]
        return np.split(inputs[0], cuts, axis=equation.params["axis"])
    numbers = _indices_of(equation.primitive.name, len(inputs))
    flat, sent = [], []
    for i, elements in enumerate(inputs):
        if i in numbers:
            sent.append(jnp.asarray(join_known(elements)))
            continue
        # zero is reserved for fill values
        first = sum(map(len, flat)) + 1
        places = np.arange(first, first + elements.size, dtype=np.int64)
        flat.append(elements.ravel())
        sent.append(jnp.asarray(places.reshape(elements.shape)))
    params = dict(equation.params)
    if "fill_value" in params:
        params["fill_value"] = 0
    with jax.ensure_compile_time_eval():
        params = equation.primitive.get_bind_params(params)
        made = equation.primitive.bind(*sent, **params)
    made = made if equation.primitive.multiple_results else [made]
    outside = np.empty(1, dtype=object)
    outside[0] = fill_of(equation)
    table = np.concatenate([outside, *flat])
    found = []
    for places in map(np.asarray, made):
        out = np.empty(places.shape, dtype=object)
        out.ravel()[:] = table[places.ravel()]
        found.append(out)
    return found


def _indices_of(name: str, count: int) -> tuple[int, ...]:
    """Return which operands of an operation are indices."""
    if name == "gather" or name.startswith("scatter"):
        return (1,)
    if name == "dynamic_slice":
        return tuple(range(1, count))
    return tuple(range(2, count)) if name == "dynamic_update_slice" else ()


def has_known_indices(equation, inputs) -> bool:
    places = _indices_of(equation.primitive.name, len(inputs))
    return all(known(inputs[i]) for i in places)


@no_type_check
def looked_up(w: Writer, equation, inputs, dtypes) -> list[np.ndarray]:
    """Emit a rearrangement by unknown indices, by comparisons or from memory."""
    name = equation.primitive.name
    if name in ("dynamic_slice", "dynamic_update_slice"):
        return _sliced(w, equation, inputs, dtypes)
    if name != "gather":
        raise Lacking(name)
    numbers = equation.params["dimension_numbers"]
    if numbers.operand_batching_dims or numbers.start_indices_batching_dims:
        raise Lacking("gather of a batch")
    if inputs[1].ndim != 1:
        return [_each_looked_up(w, equation, inputs, dtypes)]
    shape, sizes = inputs[0].shape, equation.params["slice_sizes"]
    room = [shape[d] - sizes[d] + 1 for d in numbers.start_index_map]
    # outside the array, a gather returns the fill value or the nearest element
    mode = str(equation.params["mode"]).upper()
    clips = "FILL" not in mode
    return _by_comparison(w, equation, inputs, (1,), room, clips, dtypes)


@no_type_check
def _each_looked_up(w: Writer, equation, inputs, dtypes) -> np.ndarray:
    """Emit a gather of several index vectors, one by one."""
    array, indices = inputs
    numbers = equation.params["dimension_numbers"]
    alone = numbers._replace(offset_dims=tuple(range(len(numbers.offset_dims))))
    single = equation.replace(params={**equation.params, "dimension_numbers": alone})
    vectors = indices.reshape(-1, indices.shape[-1])
    parts = [looked_up(w, single, [array, v], dtypes)[0] for v in vectors]
    shape = *indices.shape[:-1], *parts[0].shape
    found = np.concatenate([part.ravel() for part in parts]).reshape(shape)
    rest = [d for d in range(found.ndim) if d not in numbers.offset_dims]
    return np.moveaxis(found, range(found.ndim), [*rest, *numbers.offset_dims])


@no_type_check
def _sliced(w: Writer, equation, inputs, dtypes):
    first = 1 if equation.primitive.name == "dynamic_slice" else 2
    small = equation.outvars[0].aval.shape if first == 1 else inputs[1].shape
    room = [a - b + 1 for a, b in zip(inputs[0].shape, small, strict=True)]
    places = tuple(range(first, len(inputs)))
    return _by_comparison(w, equation, inputs, places, room, True, dtypes)


@no_type_check
def _by_comparison(w: Writer, equation, inputs, places, room, clips, dtypes):
    given = np.concatenate([inputs[i].ravel() for i in places])
    dtype = dtypes[places[0]]
    if np.prod(room) > _MOST:
        name = equation.primitive.name
        if name == "dynamic_update_slice":
            raise Lacking(f"{name} at {np.prod(room)} places")
        kinds = dtypes[0], dtype
        return [looked_up_in_memory(w, equation, inputs[0], given, kinds)]

    def result_at(candidate):
        sent, left = list(inputs), list(candidate)
        for i in places:
            number = inputs[i].size
            index = np.empty(number, dtype=object)
            index[:] = [dtype.type(c) for c in left[:number]]
            sent[i], left = index.reshape(inputs[i].shape), left[number:]
        return moved(equation, sent)[0]

    def here(candidate):
        flag = None
        for element, size, at in zip(given, room, candidate, strict=True):
            element = value_of(w, element, dtype)
            sign = "==" if not clips else "<=" if at == 0 else ">="
            if clips and 0 < at < size - 1:
                sign = "=="
            if size == 1 and clips:
                continue
            one = w.builder.icmp_signed(sign, element, w.like(element, at))
            flag = w.both(flag, one)
        return flag

    outputs = equation.outvars[0].aval
    candidates = list(itertools.product(*map(range, room)))
    made = result_at(candidates[0])
    if not clips:
        first = np.empty(made.shape, dtype=object)
        first.ravel()[:] = [fill_of(equation)] * made.size
        made, candidates = first, [None, *candidates]
    for candidate in candidates[1:]:
        flag, there = here(candidate), result_at(candidate)
        both = zip(made.ravel(), there.ravel(), strict=True)
        picked = np.empty(made.shape, dtype=object)
        picked.ravel()[:] = [
            old
            if flag is None or old is new
            else w.choose(
                flag,
                value_of(w, new, outputs.dtype),
                value_of(w, old, outputs.dtype),
            )
            for old, new in both
        ]
        made = picked
    return [made]


def value_of(w: Writer, element, dtype):
    """Return an element as an LLVM value."""
    return w.number(element, dtype) if is_known(element) else element


def reduced(operation: Callable, elements: np.ndarray, axes) -> np.ndarray:
    """Return the reduction of the elements along the given axes."""
    moved_axes = np.moveaxis(elements, axes, range(len(axes)))
    shape = moved_axes.shape[len(axes) :]
    columns = moved_axes.reshape((-1, *shape))
    out = np.empty(shape, dtype=object)
    for index in np.ndindex(*shape):
        total = columns[(0, *index)]
        for k in range(1, columns.shape[0]):
            total = operation(total, columns[(k, *index)])
        out[index] = total
    return out


def running(operation: Callable, elements: np.ndarray, axis: int, reverse: bool):
    """Return the cumulative reduction along an axis, forwards or backwards."""
    out = np.moveaxis(elements.copy(), axis, 0)
    out = out[::-1] if reverse else out
    for k in range(1, out.shape[0]):
        for index in np.ndindex(*out.shape[1:]):
            place = (k, *index)
            out[place] = operation(out[(k - 1, *index)], out[place])
    return np.moveaxis(out[::-1] if reverse else out, 0, axis)


def product(add: Callable, multiply: Callable, a, b, numbers) -> np.ndarray:
    """Return the product of two arrays, possibly in batches, as `dot_general` does."""
    (left, right), (batch_left, batch_right) = numbers
    rest_a = [d for d in range(a.ndim) if d not in (*left, *batch_left)]
    rest_b = [d for d in range(b.ndim) if d not in (*right, *batch_right)]
    a = a.transpose([*batch_left, *rest_a, *left])
    b = b.transpose([*batch_right, *rest_b, *right])
    n, k = len(batch_left), len(left)
    out = np.empty((*a.shape[: a.ndim - k], *b.shape[n : b.ndim - k]), dtype=object)
    for index in np.ndindex(*out.shape):
        batch, i = index[:n], index[n : n + len(rest_a)]
        j = index[n + len(rest_a) :]
        pairs = zip(np.ravel(a[(*batch, *i)]), np.ravel(b[(*batch, *j)]), strict=True)
        out[index] = functools.reduce(add, [multiply(x, y) for x, y in pairs])
    return out


@no_type_check
def extreme_place(w: Writer, name: str, elements, axes, dtype, index_dtype):
    """Return the position of the largest or smallest element along an axis; NaN takes
    precedence.
    """
    (axis,) = axes
    columns = np.moveaxis(elements, axis, 0)
    sign = "gt" if name == "argmax" else "lt"
    out = np.empty(columns.shape[1:], dtype=object)
    for index in np.ndindex(*out.shape):
        best = value_of(w, columns[(0, *index)], dtype)
        place = w.number(0, index_dtype)
        for k in range(1, columns.shape[0]):
            one = value_of(w, columns[(k, *index)], dtype)
            better = elementwise(w, sign, {}, dtype, [one, best])
            if np.issubdtype(dtype, np.floating):
                # the first NaN determines the position
                odd = elementwise(w, "ne", {}, dtype, [one, one])
                fine = elementwise(w, "eq", {}, dtype, [best, best])
                better = elementwise(w, "or", {}, np.dtype(bool), [better, odd])
                better = elementwise(w, "and", {}, np.dtype(bool), [better, fine])
            best = w.choose(better, one, best)
            place = w.choose(better, w.number(k, index_dtype), place)
        out[index] = place
    return out


def element(value) -> np.ndarray:
    """Return an array of zero dimensions that contains the value."""
    out = np.empty((), dtype=object)
    out[()] = value
    return out


def elements(values) -> np.ndarray:
    """Return a one-dimensional array of the values."""
    out = np.empty(len(values), dtype=object)
    out[:] = values
    return out
