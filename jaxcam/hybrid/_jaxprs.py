"""Reading programs that jax has traced."""

from collections.abc import Iterator

from jax.extend.core import ClosedJaxpr, Jaxpr


# calls that only group operations
_GROUPS = frozenset({"jit", "pjit", "closed_call", "call", "remat", "checkpoint"})
# linear algebra by LAPACK, Fourier transforms, and calls back to Python
_LIBRARY = frozenset(
    """
    cholesky cholesky_update debug_callback eig eigh fft ffi_call geqp3 geqrf
    hessenberg householder_product io_callback lu ormqr pure_callback qr schur svd
    symmetric_product triangular_solve tridiagonal tridiagonal_solve
    """.split()
)
_RULES = frozenset({"custom_jvp_call", "custom_vjp_call"})


def opened(equation):
    """The program inside a call that only groups, and its constants; else `None`."""
    if equation.primitive.name not in _GROUPS:
        return None
    inner = equation.params.get("jaxpr", equation.params.get("call_jaxpr"))
    return (
        (inner.jaxpr, inner.consts) if isinstance(inner, ClosedJaxpr) else (inner, [])
    )


def equations(jaxpr) -> Iterator:
    """All equations of a program and of those inside it."""
    for equation in jaxpr.eqns:
        yield equation
        for value in equation.params.values():
            for one in value if isinstance(value, (tuple, list)) else (value,):
                if isinstance(one, ClosedJaxpr):
                    yield from equations(one.jaxpr)
                elif isinstance(one, Jaxpr):
                    yield from equations(one)


def has_rule(equation) -> bool:
    """Whether an equation has a derivative of the reader's own."""
    return equation.primitive.name in _RULES and not is_series(equation)


def is_series(equation) -> bool:
    """Whether it is our own Fourier series, whose rule only saves work."""
    if equation.primitive.name != "custom_jvp_call":
        return False
    inner = equation.params["call_jaxpr"].jaxpr.eqns
    return [e.params.get("name") for e in inner] == ["fourier_sum"]


def calls_library(jaxpr) -> bool:
    """Whether some part of a program is left to a library, or to Python."""
    return any(e.primitive.name in _LIBRARY for e in equations(jaxpr))
