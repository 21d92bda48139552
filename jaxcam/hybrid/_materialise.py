"""Keep shared intermediate values of a loop body in memory.

The compiler fuses cheap operations into whatever uses them, and computes a shared value
again in each of its users; in a long body such repetitions multiply until one iteration
costs a hundred times what it should, to run and to compile. A value that the loop
carries from iteration to iteration must exist in memory, so its users read it instead.
This pass finds the values worth carrying. The results of the loop are not changed.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax.extend.core import Literal, jaxpr_as_fun
from jax.interpreters import partial_eval


# a value is kept when computing it again in its users would cost more operations
_THRESHOLD = 12
# operations that cost more than an addition
_COST = {"div": 4, "sqrt": 6, "custom_jvp_call": 40, "sin": 30, "cos": 30, "pow": 40}
_COST |= {"exp": 20, "log": 20, "atan2": 30, "atan": 20, "asin": 30, "acos": 30}


def _chosen(jaxpr) -> list:
    """The variables of a jaxpr that are worth keeping."""
    uses: dict = {}
    for equation in jaxpr.eqns:
        for v in equation.invars:
            if not isinstance(v, Literal):
                uses[v] = uses.get(v, 0) + 1
    for v in jaxpr.outvars:
        if not isinstance(v, Literal):
            uses[v] = uses.get(v, 0) + 1
    cost: dict = {}
    kept = []
    for equation in jaxpr.eqns:
        # inputs of the body and kept values cost nothing more
        price = _COST.get(equation.primitive.name, 1)
        inputs = {v for v in equation.invars if not isinstance(v, Literal)}
        price += sum(cost.get(v, 0) for v in inputs)
        for v in equation.outvars:
            number = uses.get(v, 0)
            scalar = v.aval.shape == () and v.aval.dtype in (jnp.float64, jnp.bool_)
            if number > 1 and scalar and price * (number - 1) >= _THRESHOLD:
                kept.append(v)
                cost[v] = 0
            else:
                cost[v] = price
    return kept


def while_loop(condition: Callable, body: Callable, carry):
    """`jax.lax.while_loop` whose body keeps its shared scalars in memory."""
    leaves, treedef = jax.tree.flatten(carry)
    leaves = [jnp.asarray(leaf) for leaf in leaves]

    def flat_body(*arguments):
        return jax.tree.leaves(body(jax.tree.unflatten(treedef, arguments)))

    closed = jax.make_jaxpr(flat_body)(*leaves)
    # without this, unused values would be kept too
    pruned, _ = partial_eval.dce_jaxpr(
        closed.jaxpr, [True] * len(leaves), instantiate=True
    )
    closed = closed.replace(jaxpr=pruned)
    kept = _chosen(closed.jaxpr)
    shown = closed.replace(
        jaxpr=closed.jaxpr.replace(
            outvars=[*closed.jaxpr.outvars, *kept],
            debug_info=closed.jaxpr.debug_info.with_unknown_names(),
        )
    )
    number = len(leaves)

    def run(arguments):
        state, _ = arguments
        outputs = jaxpr_as_fun(shown)(*state)
        return outputs[:number], outputs[number:]

    def unfinished(arguments):
        return condition(jax.tree.unflatten(treedef, arguments[0]))

    nothing = [jnp.zeros((), v.aval.dtype) for v in kept]
    state, values = jax.lax.while_loop(unfinished, run, (leaves, nothing))
    return jax.tree.unflatten(treedef, state), _witness(values)


def _witness(values):
    """A number that depends on all kept values, else they would be removed as unused."""
    total = jnp.zeros(())
    for v in values:
        total = total + v.astype(jnp.float64)
    return jax.lax.stop_gradient(total)


def depend_on(value, witness):
    """`value`, in a way that needs the witness. Adding 1e-300 changes no normal number."""
    return jnp.where(witness == 1.2345678901e-301, value + 1e-300, value)
