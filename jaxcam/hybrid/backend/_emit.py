"""Translate a JAX program to LLVM instructions, operation by operation."""

from typing import no_type_check

import numpy as np
from jax.extend.core import ClosedJaxpr, Literal

from ..lowering import (
    COMBINED,
    computed,
    has_program,
    join_known,
    opened,
    scattered,
)
from ._arrays import (
    extreme_place,
    has_known_indices,
    known,
    looked_up,
    moved,
    MOVES,
    product,
    reduced,
    running,
    value_of,
)
from ._control import branches, scan, while_loop
from ._elementwise import ELEMENTWISE, elementwise, REDUCED, RUNNING
from ._writer import Lacking, Writer


# operations that do not change a value
_NOTHING = frozenset({"stop_gradient", "optimization_barrier"})


class Emitter:
    """Emits JAX programs; each value is a numpy array of numbers or LLVM values."""

    def __init__(self, writer: Writer):
        self.w = writer

    @no_type_check
    def program(self, jaxpr, consts, arguments) -> list[np.ndarray]:
        """Emit a jaxpr and return its results.

        **Raises:** `Lacking` with the name of an operation that cannot be emitted.
        """
        values = dict(zip(jaxpr.constvars, map(boxed, consts), strict=True))
        values.update(zip(jaxpr.invars, arguments, strict=True))

        def read(v):
            return boxed(np.asarray(v.val)) if isinstance(v, Literal) else values[v]

        for equation in jaxpr.eqns:
            made = self._equation(equation, [read(v) for v in equation.invars])
            values.update(zip(equation.outvars, made, strict=True))
        return [read(v) for v in jaxpr.outvars]

    @no_type_check
    def _equation(self, equation, inputs):
        name, params = equation.primitive.name, equation.params
        inside = _inside(equation)
        if inside is not None:
            return self.program(*inside, inputs)
        if name in _NOTHING:
            return inputs
        if name == "unstack":
            rows = np.moveaxis(inputs[0], params["axis"], 0)
            return [rows[k, ...] for k in range(len(rows))]
        if name == "cond":
            return branches(self.w, self.program, operations, equation, inputs)
        if name == "while":
            return while_loop(self.w, self.program, equation, inputs)
        if name == "scan":
            return scan(self.w, self.program, operations, equation, inputs)
        if equation.effects:
            raise Lacking(name)
        dtypes = [v.aval.dtype for v in equation.invars]
        output = equation.outvars[0].aval
        if name in MOVES and has_known_indices(equation, inputs):
            return moved(equation, inputs)
        if inputs and all(map(known, inputs)):
            # the type of an empty array cannot be found from its elements
            arrays = [
                join_known(i) if i.size else np.empty(i.shape, d)
                for i, d in zip(inputs, dtypes, strict=True)
            ]
            return [boxed(m) for m in computed(equation, arrays)]
        if not inputs:
            return [boxed(m) for m in computed(equation, [])]
        if name in ELEMENTWISE:
            columns = [
                np.broadcast_to(i, output.shape).ravel()
                if i.shape != output.shape
                else i.ravel()
                for i in inputs
            ]
            out = np.empty(output.shape, dtype=object)
            # the type of an operation is that of its operands, not of a selector
            dtype = dtypes[1] if name == "select_n" else dtypes[0]
            out.ravel()[:] = [
                self._scalar(name, params, dtype, dtypes, scalars)
                for scalars in zip(*columns, strict=True)
            ]
            return [out]
        return [self._array(equation, inputs, dtypes, output)]

    @no_type_check
    def _array(self, equation, inputs, dtypes, output):
        name, params = equation.primitive.name, equation.params

        def pair(operation):
            return lambda a, b: self._scalar(
                operation, {}, output.dtype, [output.dtype] * 2, (a, b)
            )

        if name in REDUCED:
            return reduced(pair(REDUCED[name]), inputs[0], params["axes"])
        if name in RUNNING:
            how = params["axis"], params["reverse"]
            return running(pair(RUNNING[name]), inputs[0], *how)
        if name == "dot_general":
            numbers = params["dimension_numbers"]
            return product(pair("add"), pair("mul"), *inputs, numbers)
        if name in ("argmax", "argmin"):
            kinds = dtypes[0], output.dtype
            return extreme_place(self.w, name, inputs[0], params["axes"], *kinds)
        if name in COMBINED and has_known_indices(equation, inputs):
            made = scattered(lambda n, *e: pair(n)(*e), equation, inputs)
            if made is not None:
                return made
        if name in ("gather", "dynamic_slice", "dynamic_update_slice"):
            return looked_up(self.w, equation, inputs, dtypes)[0]
        raise Lacking(name)

    @no_type_check
    def _scalar(self, name, params, dtype, dtypes, scalars):
        values = [value_of(self.w, s, d) for s, d in zip(scalars, dtypes, strict=True)]
        return elementwise(self.w, name, params, dtype, values)


def boxed(array) -> np.ndarray:
    """Return known numbers as a numpy array of objects."""
    array = np.asarray(array)
    out = np.empty(array.shape, dtype=object)
    for index in np.ndindex(array.shape):
        out[index] = array[index]
    return out


@no_type_check
def _inside(equation):
    """Return the program and the constants of a call; otherwise `None`."""
    name, params = equation.primitive.name, equation.params
    if name in ("custom_jvp_call", "custom_vjp_call", "custom_vjp_call_jaxpr"):
        inner = params.get("call_jaxpr", params.get("fun_jaxpr"))
        return inner.jaxpr, inner.consts
    program = has_program(equation)
    if program is not None:
        return program.jaxpr, program.consts
    return opened(equation)


@no_type_check
def operations(jaxpr) -> int:
    """Return the number of operations in a program; a loop body counts once."""
    total = 0
    for equation in jaxpr.eqns:
        total += 1
        for value in equation.params.values():
            for one in value if isinstance(value, (tuple, list)) else (value,):
                if isinstance(one, ClosedJaxpr):
                    total += operations(one.jaxpr)
    return total
