"""Compile the programs of a fit."""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import equinox as eqx


P = ParamSpec("P")
T = TypeVar("T")

# With XLA's fusion emitters, half of the compilation time is spent on one MLIR context
# for each of several hundred fusions. The LLVM optimisation level is not reduced: below
# level 2, a value that is needed twice may be rounded in two ways, and derivatives of
# `min`, `max` and `clip`, which test values for equality, are then wrong.
_OPTIONS = {"xla_cpu_use_fusion_emitters": False}


def program(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a function when it is first called, as `equinox.filter_jit` does.

    This compiles faster, and the program runs as fast. It cannot be called within
    another compiled function, because XLA takes its options from the outermost one.

    Args:
        function: The function.

    Returns:
        The compiled function.
    """
    jitted: Any = eqx.filter_jit
    return jitted(function, compiler_options=_OPTIONS)
