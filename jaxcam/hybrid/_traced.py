"""A system whose three functions are traced once, to be differentiated many times.

Velocity, acceleration and jerk of the gap and what follows from them differentiate
gap and vector field some thirty times, each of which would run them as Python again.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.extend.core import jaxpr_as_fun

from ._jaxprs import equations, has_rule
from ._system import HybridSystem


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
        arguments = (*jax.tree.leaves(self.parameters), t, state)
        (result,) = jaxpr_as_fun(self.programs[name])(*arguments)
        return result


def traced(system: HybridSystem, n: int) -> HybridSystem:
    """The same system, traced for states of `n` numbers.

    One with a rule of differentiation of its own is left as it is: the rule may use
    what is known only while its function runs.
    """
    parameters, static = eqx.partition(system, eqx.is_inexact_array)
    time = jax.ShapeDtypeStruct((), jnp.float64)
    state = jax.ShapeDtypeStruct((n,), jnp.float64)

    def program(name):
        def function(parameters, t, x):
            return getattr(eqx.combine(parameters, static), name)(t, x)

        return jax.make_jaxpr(function)(parameters, time, state)

    programs = {name: program(name) for name in ("vector_field", "gap", "impact")}
    if any(has_rule(e) for p in programs.values() for e in equations(p.jaxpr)):
        return system
    return Traced(parameters, programs)
