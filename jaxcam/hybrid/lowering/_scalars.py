"""Collect operations on scalars, and trace those on which a result depends.

An operation that is repeated with the same operands is stored only once. It is traced
only when its value is `forced`, because tracing takes far longer than storing, and
array programs compute many elements on which no result depends.
"""

import functools
from collections.abc import Callable
from typing import Any, no_type_check

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import Primitive

from ._known import FOLDED, folded, is_known


_SYMMETRIC = frozenset({"add", "add_any", "mul", "max", "min"})


class Scalar:
    """The result of an operation on scalars, or a traced scalar."""

    __slots__ = ("operation", "params", "operands", "dtype", "value")

    @no_type_check
    def __init__(self, operation, params, operands, dtype, value=None):
        self.operation, self.params, self.operands = operation, params, operands
        self.dtype, self.value = dtype, value


class Part:
    """An element of a long array, which is read from the array only when needed."""

    __slots__ = ("whole", "index", "dtype")

    def __init__(self, whole, index: tuple[int, ...]):
        self.whole, self.index, self.dtype = whole, index, whole.dtype


def _read(whole, *index):
    return whole[index]


class Memory:
    """The operations of one trace, each stored once."""

    def __init__(self):
        self.made: dict[Any, Scalar] = {}
        # the scalars that represent elements of long arrays
        self.parts: dict[Any, Scalar] = {}
        # the scalars that represent traced values, keyed by the `id` of each value
        self.traced: dict[int, Scalar] = {}

    @no_type_check
    def scalar(self, element):
        """Return a traced value as a scalar; known numbers remain as they are."""
        if isinstance(element, Scalar) or is_known(element):
            return element
        if isinstance(element, Part):
            key = id(element.whole), element.index
            if key not in self.parts:
                operands = (element.whole, *element.index)
                self.parts[key] = Scalar(_read, None, operands, element.dtype)
            return self.parts[key]
        found = self.traced.get(id(element))
        if found is None:
            found = Scalar(None, None, (), element.dtype, element)
            self.traced[id(element)] = found
        return found


@no_type_check
def once(operation, params, elements, memory: Memory, dtype=None):
    """Return the result of a primitive or of a function of scalars, stored only once.

    **Arguments:** the operation and its parameters, its operands, and the type of the
    result if it is not that of the last operand.
    """
    primitive = isinstance(operation, Primitive)
    name = operation.name if primitive else operation.__name__
    scalars = [memory.scalar(e) for e in elements]
    shortcut = _identity(name, scalars)
    if shortcut is not None:
        return shortcut
    if name in FOLDED and all(map(is_known, scalars)):
        return folded(name, scalars)
    operands = [_key(s) for s in scalars]
    if name in _SYMMETRIC and _place(operands[1]) < _place(operands[0]):
        operands.reverse()
    chosen = {key: value for key, value in params.items() if value is not None}
    key = (name, str(chosen) if chosen else "", *operands)
    found = memory.made.get(key)
    if found is None:
        dtype = scalars[-1].dtype if dtype is None else dtype
        found = Scalar(operation, params, scalars, dtype)
        memory.made[key] = found
    return found


@no_type_check
def _key(scalar):
    if not is_known(scalar):
        return id(scalar)
    value = scalar.item() if isinstance(scalar, np.generic) else scalar
    return (value, str(np.result_type(scalar)))


@no_type_check
def _place(key):
    return (0, key) if isinstance(key, int) else (1, hash(key))


@no_type_check
def forced(element, memory: Memory):
    """Return the traced value of a scalar; other elements are already values and are
    returned unchanged.
    """
    if isinstance(element, Part):
        element = memory.scalar(element)
    if not isinstance(element, Scalar):
        return element
    waiting = [element]
    while waiting:
        scalar = waiting[-1]
        if scalar.value is not None:
            waiting.pop()
            continue
        missing = [
            s for s in scalar.operands if isinstance(s, Scalar) and s.value is None
        ]
        if missing:
            waiting.extend(reversed(missing))
            continue
        waiting.pop()
        values = [s.value if isinstance(s, Scalar) else s for s in scalar.operands]
        scalar.value = _applied(scalar.operation, scalar.params, values)
        if not isinstance(scalar.value, tuple):
            memory.traced.setdefault(id(scalar.value), scalar)
    return element.value


@no_type_check
def _applied(operation: Callable, params, values):
    if not isinstance(operation, Primitive):
        return operation(*values)
    given = _defaults(operation.name) | params
    return operation.bind(*map(jnp.asarray, values), **given)


@functools.cache
def _defaults(name: str) -> dict:
    """Return the parameters that JAX adds whenever it applies a primitive."""
    if name != "mul":
        return {}
    # reverse mode fails without these parameters
    return jax.make_jaxpr(jax.lax.mul)(1.0, 1.0).eqns[0].params


@no_type_check
def _identity(name, scalars):
    """Return the simplified result of an operation with a known number, such as zero or
    one, or with equal cases; otherwise `None`. Differentiation produces many such
    operations.
    """
    if name == "select_n":
        which, *cases = scalars
        if is_known(which):
            return cases[int(which)]
        same = all(c is cases[0] or _is_same(c, cases[0]) for c in cases)
        return cases[0] if same else None
    if len(scalars) != 2:
        return None
    a, b = scalars
    if name in ("and", "or"):
        for known, other in ((a, b), (b, a)):
            if isinstance(known, (bool, np.bool_)):
                return other if bool(known) == (name == "and") else known
        return None
    if name == "mul":
        for known, other in ((a, b), (b, a)):
            if is_known(known) and isinstance(known, np.floating):
                if known == 1.0:
                    return other
                if known == 0.0:
                    return known
        return None
    if name == "div":
        one = is_known(b) and isinstance(b, np.floating) and b == 1.0
        return a if one or (_is_zero(a) and not is_known(b)) else None
    if name in ("add", "add_any", "sub"):
        if _is_zero(b):
            return a
        if name != "sub" and _is_zero(a):
            return b
    return None


@no_type_check
def _is_same(a, b) -> bool:
    return is_known(a) and is_known(b) and a == b and np.signbit(a) == np.signbit(b)


@no_type_check
def _is_zero(scalar) -> bool:
    return is_known(scalar) and isinstance(scalar, np.floating) and scalar == 0.0
