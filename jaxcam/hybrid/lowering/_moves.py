"""Operations that only move the elements of an array."""

from typing import no_type_check

import jax
import jax.numpy as jnp
import numpy as np

from ._elements import join_traced, split
from ._known import is_known, join_known


MOVES = frozenset(
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
"""Names of operations that only move the elements of an array."""


@no_type_check
def rearranged(equation, inputs) -> np.ndarray | None:
    """Return the result of a common rearrangement, found with numpy alone; `None` for
    any other operation.
    """
    name, params, first = equation.primitive.name, equation.params, inputs[0]
    if name in ("reshape", "squeeze", "expand_dims", "copy"):
        return first.reshape(equation.outvars[0].aval.shape)
    if name == "slice":
        strides = params["strides"] or (1,) * first.ndim
        cuts = zip(params["start_indices"], params["limit_indices"], strides)
        return first[tuple(slice(*c) for c in cuts)]
    if name == "dynamic_slice":
        return _slice_at(first, inputs[1:], params["slice_sizes"])
    if name == "concatenate":
        return np.concatenate(inputs, axis=params["dimension"])
    if name == "stack":
        return np.stack(inputs, axis=params["axis"])
    if name == "pad":
        return _padded(first, inputs[1][()], params["padding_config"])
    if name == "transpose":
        return first.transpose(params["permutation"])
    if name == "broadcast_in_dim":
        shape, kept = params["shape"], params["broadcast_dimensions"]
        sizes = [1] * len(shape)
        for axis, dimension in enumerate(kept):
            sizes[dimension] = first.shape[axis]
        return np.broadcast_to(first.reshape(sizes), shape).copy()
    return None


@no_type_check
def _slice_at(array, starts, sizes) -> np.ndarray | None:
    """Return the slice that begins at known indices; otherwise `None`."""
    indices = [start[()] for start in starts]
    if not all(map(is_known, indices)):
        return None
    spans = zip(indices, sizes, array.shape, strict=True)
    first = [int(np.clip(i, 0, most - size)) for i, size, most in spans]
    return array[tuple(slice(k, k + n) for k, n in zip(first, sizes, strict=True))]


@no_type_check
def _padded(array, fill, config) -> np.ndarray | None:
    """Return the array with equal elements around it; `None` for any other padding."""
    if any(low < 0 or high < 0 or inner for low, high, inner in config):
        return None
    shape = [n + low + high for n, (low, high, _) in zip(array.shape, config)]
    out = np.empty(shape, dtype=object)
    out.fill(fill)
    spans = zip(array.shape, config, strict=True)
    out[tuple(slice(low, low + n) for n, (low, _, _) in spans)] = array
    return out


def moved(equation, inputs, memory):
    """Return the moved elements, which are found by moving their indices."""
    simple = rearranged(equation, inputs)
    if simple is not None:
        return simple
    first, others = inputs[0], [join_known(i) for i in inputs[1:]]
    params = equation.params
    indices = np.arange(first.size, dtype=np.int64).reshape(first.shape)
    with jax.ensure_compile_time_eval():
        target = np.asarray(
            equation.primitive.bind(*map(jnp.asarray, (indices, *others)), **params)
        )
    if target.size and (target.min() < 0 or target.max() >= first.size):
        # a gather that reads outside the array, where it returns a fill value
        whole = join_traced(first, memory)
        return split(equation.primitive.bind(whole, *others, **params))
    out = np.empty(target.shape, dtype=object)
    out.ravel()[:] = first.ravel()[target.ravel()]
    return out
