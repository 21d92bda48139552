"""Read programs traced by JAX.

Functions that are called for every equation take no arrays. They are not type-checked
in the tests, because the tests would then take a fifth longer.
"""

import math
from collections.abc import Callable, Iterator
from typing import no_type_check

import jax
from jax.extend.core import ClosedJaxpr, Jaxpr
from jax.interpreters import partial_eval


# calls that only group operations
_GROUPS = frozenset({"jit", "pjit", "closed_call", "call", "remat", "checkpoint"})
# operations outside the compiled code: linear algebra, Fourier transforms, and calls
# back to Python
_LIBRARY = frozenset(
    """
    cholesky cholesky_update debug_callback eig eigh fft ffi_call geqp3 geqrf
    hessenberg householder_product io_callback lu ormqr pure_callback qr schur svd
    symmetric_product triangular_solve tridiagonal tridiagonal_solve
    """.split()
)
# operations that the CPU backend cannot include in a kernel
_CALLS = frozenset(
    """
    approx_top_k conv_general_dilated select_and_scatter_add select_and_gather_add sort
    top_k
    """.split()
)
# name given to compiled functions whose custom derivative only saves work
_SAVING = "its_derivative_only_saves_work"


@no_type_check
def opened(equation):
    """Return the program inside a call that only groups operations, and its constants;
    otherwise `None`.
    """
    if equation.primitive.name not in _GROUPS:
        return None
    inner = equation.params.get("jaxpr", equation.params.get("call_jaxpr"))
    return (
        (inner.jaxpr, inner.consts) if isinstance(inner, ClosedJaxpr) else (inner, [])
    )


def equations(jaxpr) -> Iterator:
    """Yield all equations of a program and of the programs inside it."""
    for equation in jaxpr.eqns:
        yield equation
        for value in equation.params.values():
            for one in value if isinstance(value, (tuple, list)) else (value,):
                if isinstance(one, ClosedJaxpr):
                    yield from equations(one.jaxpr)
                elif isinstance(one, Jaxpr):
                    yield from equations(one)


def without_unused(closed: ClosedJaxpr, used: list[bool] | None = None) -> ClosedJaxpr:
    """Return a program without the equations on which no used result depends."""
    jaxpr = closed.jaxpr
    used = [True] * len(jaxpr.outvars) if used is None else used
    less, _ = partial_eval.dce_jaxpr(jaxpr, used, instantiate=True)
    return ClosedJaxpr(less, closed.consts)


def used_inputs(closed: ClosedJaxpr) -> list[bool]:
    """Return which inputs of a program its results depend on."""
    every = [True] * len(closed.jaxpr.outvars)
    return list(partial_eval.dce_jaxpr(closed.jaxpr, every)[1])


def saving_jvp(function: Callable) -> jax.custom_jvp:
    """Apply `jax.custom_jvp` with a derivative that is equal to that of the function
    but cheaper.

    Such a function may be inlined, and is then as fast as any other arithmetic. A
    function with any other custom derivative must remain a call.
    """

    def marked(*arguments):
        return function(*arguments)

    marked.__name__ = _SAVING
    return jax.custom_jvp(jax.jit(marked))


@no_type_check
def has_saving_rule(equation) -> bool:
    """Return whether an equation calls a function made by `saving_jvp`."""
    if equation.primitive.name != "custom_jvp_call":
        return False
    inner = equation.params["call_jaxpr"].jaxpr.eqns
    return [e.params.get("name") for e in inner] == [_SAVING]


def calls_library(jaxpr) -> bool:
    """Return whether any part of a program calls a library or Python."""
    return any(e.primitive.name in _LIBRARY for e in equations(jaxpr))


def fits_kernel(jaxpr) -> bool:
    """Return whether the CPU backend can compile a program as one kernel."""
    return not any(map(_needs_more, equations(jaxpr)))


@no_type_check
def _needs_more(equation) -> bool:
    name = equation.primitive.name
    if name.startswith("scatter"):
        # a scatter at one index is the update of a slice, which fits
        return math.prod(equation.invars[1].aval.shape[:-1]) > 1
    if name == "dot_general":
        return equation.outvars[0].aval.ndim > 1
    return name in _LIBRARY | _CALLS
