"""Find corners and jumps in the functions of a system, from their traced programs."""

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, no_type_check

import jax
import jax.numpy as jnp
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal

from ..parameters import as_arrays, real_array, VectorLike
from ._switched import SwitchedSystem
from ._system import HybridSystem
from .surface import OnSides


# JAX operations with a corner or a jump, and the names under which users call them
_CORNERS = {
    "abs": "abs",
    "argmax": "argmax",
    "argmin": "argmin",
    "ceil": "ceil",
    "clamp": "clip",
    "cond": "cond",
    "floor": "floor",
    "max": "maximum",
    "min": "minimum",
    "reduce_max": "max",
    "reduce_min": "min",
    "rem": "remainder",
    "round": "round",
    "sign": "sign",
    "sort": "sort",
    "while": "while_loop",
}
# compiled functions of `jax.numpy`: a corner inside one of them is reported under the
# name of the function, at the line where it is called
_NUMPY = {
    "_where": "where",
    "clip": "clip",
    "divmod": "divmod",
    "floor_divide": "floor_divide",
    "fmod": "fmod",
    "remainder": "remainder",
    "round": "round",
    "trunc": "trunc",
}
# folders of libraries, whose code is not the user's
_LIBRARIES = tuple(f"/site-packages/{name}/" for name in ("jax", "jaxlib", "equinox"))


@dataclasses.dataclass(frozen=True)
class Corner:
    """A place where a function of a system is not smooth in time or state.

    Examples:
        >>> from jaxcam.hybrid import Corner
        >>> print(Corner("gap", "abs", "", 0).operation)
        abs
    """

    function: str
    """Method of the system: `"vector_field"` (or `"branch"`), `"gap"`, ..."""
    operation: str
    """The operation with a corner or a jump, such as `"abs"` or `"where"`."""
    file: str
    """File of the source, or the empty string if unknown."""
    line: int
    """Line in the file, from 1; 0 if unknown."""

    def __str__(self) -> str:
        place = f"{Path(self.file).name}:{self.line}: " if self.line else ""
        return (
            f"{place}`{self.operation}` in `{self.function}` has a corner or a jump "
            "that depends on time or state; define it as a switching surface of a "
            "jaxcam.hybrid.SwitchedSystem, or, at fixed times, as a breakpoint"
        )


def corners(system: HybridSystem, state: VectorLike) -> list[Corner]:
    """Return the places where the functions of a system are not smooth.

    The functions are traced, not evaluated. The operations `abs`, `sign`, `where`,
    `maximum`, `minimum`, `clip`, `floor`, `remainder` and similar ones are reported if
    their arguments, or the condition of a `where`, depend on time or state. A
    simulation crosses such a corner with shortened steps and a larger error, whereas a
    [`jaxcam.hybrid.SwitchedSystem`][] locates it as an event. A `where` that only
    avoids a division by zero is reported as well. Quadratic drag, `v * abs(v)`, is not
    reported, nor are operations that depend only on time in a system with breakpoints.

    Args:
        system: The system.
        state: Any state, shape `(n,)`; only its number of components matters.

    Returns:
        A list of `Corner`, each of which prints as a sentence; empty for smooth
            functions.

    Examples:
        >>> from jaxcam.hybrid import corners
        >>> class Absolute(jaxcam.models.BouncingBall):
        ...     def vector_field(self, t, state):
        ...         return jnp.stack([state[1], -9.81 - jnp.abs(state[1])])
        >>> [corner.operation for corner in corners(Absolute(), [1.0, 0.0])]
        ['abs']
    """
    system, state = as_arrays(system), real_array(state)
    functions: dict[str, Callable] = {}
    if isinstance(system, SwitchedSystem):
        values = jnp.atleast_1d(system.switching(jnp.zeros(()), state))
        mode = OnSides(system, jnp.zeros(values.shape, dtype=bool))
        functions["branch"] = mode.vector_field
        functions["switching"] = system.switching
        functions["reset"] = lambda t, x: system.reset(t, x, mode.signs)
    else:
        functions["vector_field"] = system.vector_field
    functions |= {"gap": system.gap, "impact": system.impact}
    found: dict[Corner, None] = {}
    # steps end at breakpoints, so a switch at a fixed time is harmless
    moving = [system.breakpoints is None, True]
    for name, function in functions.items():
        closed = jax.make_jaxpr(function)(jnp.zeros(()), state)
        seen = _corners_in(closed.jaxpr, moving, None)
        found |= {Corner(name, operation, *place): None for operation, place in seen}
    return list(found)


@no_type_check
def _corners_in(jaxpr, known, where) -> Iterator[tuple[str, tuple[str, int]]]:
    """Yield the name, file and line of each operation with a corner.

    **Arguments:** the program; which of its arguments depend on time or state; and, for
    operations inside a function of `jax.numpy`, the name and place of its call.
    """
    depends = {id(v) for v, moves in zip(jaxpr.invars, known, strict=True) if moves}
    for equation in jaxpr.eqns:
        moves = [
            not isinstance(v, Literal) and id(v) in depends for v in equation.invars
        ]
        if not any(moves):
            continue
        name = equation.primitive.name
        place = where or (None, _place(equation))
        if _is_corner(equation, name, moves) and not _is_squared(jaxpr, equation):
            yield place[0] or _CORNERS.get(name, "where"), place[1]
        inside = _inside(equation)
        if inside is not None and len(inside.invars) == len(moves):
            called = _NUMPY.get(equation.params.get("name"))
            inner = (called, place[1]) if called and where is None else where
            yield from _corners_in(inside, moves, inner)
        depends |= {id(v) for v in equation.outvars}


@no_type_check
def _is_corner(equation, name, moves) -> bool:
    if name == "select_n":
        return moves[0]
    if name == "cond":
        return moves[0]
    if name == "convert_element_type":
        # a condition that is converted to a number jumps from 0 to 1
        return equation.invars[0].aval.dtype == bool
    if name in ("max", "min", "abs", "sign", "sort"):
        return jnp.issubdtype(equation.outvars[0].aval.dtype, jnp.inexact)
    return name in _CORNERS


# operations that only change the sign, the shape or the type of their argument
_PASSED_ON = ("neg", "squeeze", "reshape", "broadcast_in_dim", "convert_element_type")


@no_type_check
def _is_squared(jaxpr, equation) -> bool:
    """Return whether an absolute value, or a multiple of it, is used only in products
    with a multiple of its argument: `v * abs(v)` has a continuous derivative.
    """
    if equation.primitive.name != "abs":
        return False
    values = _value_numbers(jaxpr)
    along = {values[id(equation.invars[0])]}
    held, used = {values[id(equation.outvars[0])]}, False
    for other in jaxpr.eqns:
        name = other.primitive.name
        inputs = [None if isinstance(v, Literal) else v for v in other.invars]
        parts = [values[id(v)] for v in inputs if v is not None]
        out, factors = values[id(other.outvars[0])], parts
        multiple = name in ("mul", "div", *_PASSED_ON)
        if name == "div":
            # a quotient is a multiple of its numerator only
            above, below = inputs
            factors = [] if above is None else [values[id(above)]]
            if below is not None and values[id(below)] in along | held:
                multiple = False
        if held.intersection(parts):
            if not multiple or not held.intersection(factors):
                return False
            if name == "mul" and along.intersection(parts):
                used = True
            elif name == "mul" and len(parts) > 1 and held.issuperset(parts):
                return False
            else:
                held.add(out)
        elif multiple and along.intersection(factors):
            along.add(out)
    return used and held.isdisjoint(values.get(id(v)) for v in jaxpr.outvars)


@no_type_check
def _value_numbers(jaxpr) -> dict[int, object]:
    """Return a number for each variable; variables that are computed in the same way
    from the same variables have the same number.
    """
    numbers, known = {}, {}

    def number(key):
        return known.setdefault(key, len(known))

    for variable in (*jaxpr.invars, *jaxpr.constvars):
        numbers[id(variable)] = number(id(variable))
    for equation in jaxpr.eqns:
        parts = [
            repr(v.val) if isinstance(v, Literal) else numbers[id(v)]
            for v in equation.invars
        ]
        for place, out in enumerate(equation.outvars):
            key = equation.primitive.name, str(equation.params), (*parts,), place
            numbers[id(out)] = number(key)
    return numbers


@no_type_check
def _inside(equation):
    """Return the program that an equation calls, or `None`."""
    for key in ("jaxpr", "call_jaxpr", "fun_jaxpr"):
        inner = equation.params.get(key)
        if isinstance(inner, ClosedJaxpr):
            return inner.jaxpr
        if isinstance(inner, Jaxpr):
            return inner
    return None


def _place(equation: Any) -> tuple[str, int]:
    """Return the file and line of the innermost call that is not inside a library."""
    trace = equation.source_info.traceback
    for frame in trace.frames if trace is not None else ():
        name = frame.file_name.replace("\\", "/")
        if not any(library in name for library in _LIBRARIES):
            return frame.file_name, frame.line_num
    return "", 0
