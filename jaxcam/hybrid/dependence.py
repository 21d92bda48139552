"""Find which results of a function depend on its arguments."""

from typing import Any


def dependent(closed: Any) -> list[bool]:
    """Return, for each result of a traced function (`jax.make_jaxpr`), whether it
    depends on an argument.
    """
    known = {id(v) for v in closed.jaxpr.invars}
    for equation in closed.jaxpr.eqns:
        if any(id(v) in known for v in equation.invars):
            known |= {id(v) for v in equation.outvars}
    return [id(v) in known for v in closed.jaxpr.outvars]
