"""Compile a loop as one kernel on the CPU, instead of hundreds of small ones.

XLA's CPU backend compiles a small loop into a single function, and runs a large one as
a sequence of kernels whose calls cost more than the arithmetic of a step. It marks the
small ones by an attribute on a call. Here the attribute is set from the start, on this
loop alone; a version of XLA that does not know it ignores it. Results are the same.
"""

from collections.abc import Callable

import jax
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend.core import jaxpr_as_fun

from ._jaxprs import calls_library


_KEPT = {"inlineable": "false", "xla_cpu_small_call": "true"}
_INLINED = {"inlineable": "true"}


def one_kernel(function: Callable, batch: bool = False) -> Callable:
    """`function` of one pytree, as a call that the CPU backend keeps in one piece.

    With `batch` the calls inside are inlined: better for wide vectors, worse for single
    trajectories and their derivatives. A function that needs a library is called as it
    is: such calls cannot be part of a kernel.
    """

    def call(argument):
        if jax.default_backend() != "cpu":
            return function(argument)
        # the calls inside take the tag of the moment they are traced at
        with set_xla_metadata(**(_INLINED if batch else _KEPT)):
            closed, shape = jax.make_jaxpr(function, return_shape=True)(argument)

        def flat(argument):
            leaves = jaxpr_as_fun(closed)(*jax.tree.leaves(argument))
            return jax.tree.unflatten(jax.tree.structure(shape), leaves)

        if calls_library(closed.jaxpr):
            return function(argument)
        with set_xla_metadata(**_KEPT):
            result = jax.jit(flat)(argument)
        # XLA aborts on such a call if some of its results are dropped
        return jax.lax.optimization_barrier(result)

    return call
