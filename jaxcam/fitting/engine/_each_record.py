"""Run the same program for every recording on all cores; XLA uses one core per call."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import jax
import jax.numpy as jnp


T = TypeVar("T")


def each_record(function: Callable[[int], T], records: int) -> T:
    """Stack the results of `function` for each number below `records` along a new axis.

    Calls run in threads, so nothing may be traced here. The result does not depend on
    the number of cores.
    """
    # the first call may compile, which must not happen in two threads
    parts = [function(0)]
    if records > 1:
        with ThreadPoolExecutor() as pool:
            rest = range(1, records)
            parts += pool.map(lambda row: jax.block_until_ready(function(row)), rest)
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *parts)
