"""Scatters into small arrays, at indices that are known while tracing."""

import functools
from collections.abc import Callable
from typing import no_type_check

import numpy as np


COMBINED = {
    "scatter-add": "add",
    "scatter-sub": "sub",
    "scatter-mul": "mul",
    "scatter-min": "min",
    "scatter-max": "max",
}
"""The scatters that combine old and new values, each with its operation."""


@no_type_check
def scattered(combine: Callable, equation, inputs) -> np.ndarray | None:
    """Return the elements after a scatter, `None` if it applies another operation.

    **Arguments:** `combine(name, old, new)`, which applies an operation in `COMBINED`;
    the equation; and its operands as arrays of scalars, the indices being known.
    """
    onto, where, given = inputs
    numbers = equation.params["dimension_numbers"]
    name = COMBINED.get(equation.primitive.name)
    if name is None and not replaces(equation):
        return None
    clips = "CLIP" in str(equation.params["mode"]).upper()
    place_of = functools.partial(
        _place, numbers, where, given.shape, onto.shape, clips=clips
    )
    out = onto.copy()
    for index in np.ndindex(given.shape):
        place = place_of(index)
        if place is not None:
            new = given[index]
            out[place] = new if name is None else combine(name, out[place], new)
    return out


@no_type_check
def replaces(equation) -> bool:
    """Return whether a scatter replaces old values by new ones; otherwise, it applies a
    function to them.
    """
    update = equation.params["update_jaxpr"]
    return update is None or update.outvars == update.invars[1:]


@no_type_check
def _place(numbers, where, sizes, shape, index, clips) -> tuple | None:
    """Return the place of an update in the array; `None` if its window is outside."""
    windows = numbers.update_window_dims
    batch = tuple(i for d, i in enumerate(index) if d not in windows)
    vector, batched = where[batch], numbers.operand_batching_dims
    single = (*numbers.inserted_window_dims, *batched)
    kept = [d for d in range(len(shape)) if d not in single]
    first, offset, spans = [0] * len(shape), [0] * len(shape), [1] * len(shape)
    for d, i in zip(kept, windows, strict=True):
        offset[d], spans[d] = index[i], sizes[i]
    for d, start in zip(numbers.scatter_dims_to_operand_dims, vector, strict=True):
        first[d] = int(start)
    for d, k in zip(batched, numbers.scatter_indices_batching_dims, strict=True):
        first[d] = batch[k]
    last = [most - span for most, span in zip(shape, spans, strict=True)]
    if clips:
        first = [min(max(i, 0), most) for i, most in zip(first, last, strict=True)]
    if any(i < 0 or i > most for i, most in zip(first, last, strict=True)):
        return None
    return tuple(i + k for i, k in zip(first, offset, strict=True))
