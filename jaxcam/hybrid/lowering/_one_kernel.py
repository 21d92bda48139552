"""Compile a loop as one kernel on the CPU, instead of hundreds of small ones.

XLA's CPU backend compiles a small loop into a single function, but runs a large one as
a sequence of kernels whose calls take longer than the arithmetic of a step. XLA marks
small loops by an attribute of a call. This module sets the attribute in advance, only
for the loop that it wraps; versions of XLA without the attribute ignore it. The results
are the same.
"""

from collections.abc import Callable

from ._whole import whole


def one_kernel(function: Callable, batch: bool = False, on: bool = True) -> Callable:
    """Wrap `function` of one pytree as a call that the CPU backend does not split.

    With `batch`, the calls inside are inlined, which is better for wide vectors and
    worse for individual trajectories and their derivatives. A function that the backend
    cannot compile as one kernel, because it needs a library, is compiled as usual, as
    is every function if `on` is false.
    """
    if not on:
        return function
    return whole(function, kernel={"inlineable": "true" if batch else "false"})
