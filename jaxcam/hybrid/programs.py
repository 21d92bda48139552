"""Compile functions with options that shorten compilation."""

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import equinox as eqx
import jax
from jax._src.core import trace_state_clean
from jax.core import Tracer


P = ParamSpec("P")
T = TypeVar("T")

# With XLA's fusion emitters, half of the compilation time is spent on one MLIR context
# for each of several hundred fusions. The LLVM optimisation level is not reduced: below
# level 2, a value that is needed twice may be rounded in two ways, and derivatives of
# `min`, `max` and `clip`, which test values for equality, are then wrong.
_OPTIONS = {"xla_cpu_use_fusion_emitters": False}


def is_traced(tree) -> bool:
    """Return whether any array in `tree` is traced, so that its value is unknown."""
    return any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(tree))


def is_tracing() -> bool:
    """Return whether a computation is being traced into a program, as inside `jit`."""
    return isinstance(jax.lax.stop_gradient(0.0), Tracer)


def is_outermost() -> bool:
    """Return whether no transformation of JAX is active, not even `vmap` or `jvp`."""
    return trace_state_clean()


def program(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a function when it is first called, as `equinox.filter_jit` does.

    Compilation takes about half the usual time, and the program runs as fast. Within
    `jit`, `vmap`, `jvp` and `grad`, the function is compiled with the usual options.

    Args:
        function: The function.

    Returns:
        The compiled function.
    """
    jitted: Any = eqx.filter_jit
    # JAX rejects compiler options within other transformations; the arguments do not
    # reveal these, because a function may have captured traced values
    inner, outermost = jitted(function), jitted(function, compiler_options=_OPTIONS)

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        return (outermost if is_outermost() else inner)(*args, **kwargs)

    return call
