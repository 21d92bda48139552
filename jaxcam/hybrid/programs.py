"""Compile functions with options that shorten compilation."""

import contextlib
import ctypes
import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import equinox as eqx
import jax
from jax._src import config, pjit
from jax._src.core import trace_state_clean
from jax._src.interpreters import pxla
from jax.core import Tracer


P = ParamSpec("P")
T = TypeVar("T")

# With XLA's fusion emitters, half of the compilation time is spent on one MLIR context
# for each of several hundred fusions. The LLVM optimisation level is not reduced: below
# level 2, a value that is needed twice may be rounded in two ways, and derivatives of
# `min`, `max` and `clip`, which test values for equality, are then wrong. YNNPACK is
# only used for products of matrices, because its sums over short axes are slow.
_OPTIONS = {
    "xla_cpu_use_fusion_emitters": False,
    "xla_cpu_experimental_ynn_fusion_type": "LIBRARY_FUSION_TYPE_DOT",
}
# message of a version of XLA that lacks an option; programs then run without options
_UNKNOWN = "No such compile option"
# JAX keeps what it passed to the compiler, which needs more memory than the compiled
# program: in a diagnosis, several hundred megabytes. These caches, and the setting
# below, are not public; without them, a program needs more memory
_LOWERED = getattr(pjit, "_pjit_lower", None)
_PASSED = (_LOWERED, getattr(pxla, "_cached_lowering_to_hlo", None))
_STACK_DEPTH = getattr(config, "traceback_in_locations_limit", None)


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
        nonlocal outermost
        if not is_outermost():
            return inner(*args, **kwargs)
        before = _lowered()
        # a compiled program contains the Python stack of each of its operations, up to
        # this depth, which would double its size
        with contextlib.nullcontext() if _STACK_DEPTH is None else _STACK_DEPTH(0):
            try:
                found = outermost(*args, **kwargs)
            except jax.errors.JaxRuntimeError as error:
                if _UNKNOWN not in str(error):
                    raise
                outermost = inner
                found = inner(*args, **kwargs)
        if _lowered() != before:
            _forget_lowered()
        return found

    return call


def _lowered() -> int:
    """Return the number of programs that have been passed to the compiler."""
    return 0 if _LOWERED is None else _LOWERED.cache_info().misses


def _forget_lowered() -> None:
    """Discard the input of the compiler, which compiled programs do not need, and
    return unused memory to the operating system.
    """
    for cache in _PASSED:
        if cache is not None:
            cache.cache_clear()
    if _TRIM is not None:
        _TRIM(0)


def _found_trim():
    """Return the function of the C library that returns unused memory, or `None`."""
    try:
        return ctypes.CDLL(None).malloc_trim
    except (OSError, TypeError, AttributeError):
        return None


# the GNU library keeps memory that the compiler has freed
_TRIM = _found_trim()
