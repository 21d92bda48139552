"""Compile a loop as one kernel on the CPU, instead of hundreds of small ones.

XLA's CPU backend compiles a small loop into a single function, and runs a large one as
a sequence of kernels whose calls cost more than the arithmetic of a step. It marks the
small ones by an attribute on a call. This module sets the attribute in advance, for
this loop only; versions of XLA without the attribute ignore it. Results are the same.
"""

from collections.abc import Callable

from ._whole import whole


def one_kernel(function: Callable, batch: bool = False, on: bool = True) -> Callable:
    """Wrap `function` of one pytree as a call that the CPU backend does not split.

    With `batch` the calls inside are inlined: better for wide vectors, worse for single
    trajectories and their derivatives. A function that the backend cannot write as one
    kernel, because it needs a library, is compiled as it is; without `on`, any is.
    """
    if not on:
        return function
    return whole(function, kernel={"inlineable": "true" if batch else "false"})
