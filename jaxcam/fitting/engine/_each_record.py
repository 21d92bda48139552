"""Run the same program for every recording on all cores; XLA uses one core per call."""

import os
from collections.abc import Callable, Hashable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ...hybrid.caches import Cache


T = TypeVar("T")
# kinds of arguments for which a program has been compiled
_COMPILED = Cache(4096)


def each_record(function: Callable[[int], T], records: int, args: Any) -> T:
    """Stack the results of `function` for each number below `records` along a new axis.

    Calls run in threads, so nothing may be traced here. The result does not depend on
    the number of cores.

    **Arguments:** `args` are the program, arrays and settings that the function uses.
    """
    first: list[T] = []

    def compiled() -> bool:
        first.append(function(0))
        return True

    # the first call compiles, which must not happen in two threads
    _COMPILED.get(kinds(args), compiled)

    def ready(row: int) -> T:
        return jax.block_until_ready(function(row))

    rest = range(len(first), records)
    if len(rest) > 1:
        with ThreadPoolExecutor(_cores()) as pool:
            parts = [*first, *pool.map(ready, rest)]
    else:
        parts = [*first, *map(function, rest)]
    # stack with NumPy, because JAX would compile a program for each shape
    return jax.tree.map(lambda *leaves: jnp.asarray(np.stack(leaves)), *parts)


def of_record(arrays: T, row: int) -> T:
    """Return the arrays of one recording from those of all recordings.

    A program for these arrays does not depend on the number of recordings.
    """
    # slices of NumPy, because JAX would compile a program for each shape
    return jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf)[row]), arrays)


def kinds(args) -> Hashable:
    """Return the properties of the arguments on which a compiled program depends:
    shapes, types and static values.
    """

    def kind(leaf) -> Hashable:
        if hasattr(leaf, "shape"):
            return leaf.shape, leaf.dtype, getattr(leaf, "weak_type", False)
        return leaf

    leaves, structure = jax.tree.flatten(args)
    return structure, tuple(map(kind, leaves))


def _cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
