"""A system whose three functions are traced once, to be differentiated many times.

Velocity, acceleration and jerk of the gap and what follows from them differentiate
gap and vector field some thirty times. Each time the functions would run as Python
again, in which most of a first call would be spent.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.extend.core import Literal

from ._system import HybridSystem


# calls that only group operations
_GROUPS = frozenset({"jit", "pjit", "closed_call", "core_call"})


class Traced(HybridSystem):
    """The three functions of a system, as programs of its parameters."""

    parameters: Any
    programs: dict = eqx.field(static=True)

    def vector_field(self, t, state):
        return self._run("vector_field", t, state)

    def gap(self, t, state):
        return self._run("gap", t, state)

    def impact(self, t, state):
        return self._run("impact", t, state)

    def _run(self, name, t, state) -> Any:
        program = self.programs[name]
        arguments = (*jax.tree.leaves(self.parameters), t, state)
        (result,) = _evaluate(program.jaxpr, program.consts, arguments)
        return result


def traced(system: HybridSystem, n: int) -> Traced:
    """The same system, traced for states of `n` numbers."""
    parameters, static = eqx.partition(system, eqx.is_inexact_array)
    time = jax.ShapeDtypeStruct((), jnp.float64)
    state = jax.ShapeDtypeStruct((n,), jnp.float64)

    def program(name):
        def function(parameters, t, x):
            return getattr(eqx.combine(parameters, static), name)(t, x)

        return jax.make_jaxpr(function)(parameters, time, state)

    names = ("vector_field", "gap", "impact")
    return Traced(parameters, {name: program(name) for name in names})


def _evaluate(jaxpr, constants, arguments):
    values = dict(zip(jaxpr.constvars, constants, strict=True))
    values.update(zip(jaxpr.invars, arguments, strict=True))

    def read(v):
        return v.val if isinstance(v, Literal) else values[v]

    for equation in jaxpr.eqns:
        primitive, inputs = equation.primitive, [read(v) for v in equation.invars]
        if primitive.name in _GROUPS:
            inner = equation.params["jaxpr"]
            made = _evaluate(inner.jaxpr, inner.consts, inputs)
        else:
            made = primitive.bind(*inputs, **primitive.get_bind_params(equation.params))
            made = made if primitive.multiple_results else [made]
        values.update(zip(equation.outvars, made, strict=True))
    return [read(v) for v in jaxpr.outvars]
