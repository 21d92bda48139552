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


def with_kept(body: Callable, carry):
    """A loop body that also carries its shared scalars.

    **Arguments:** `body(carry) -> (carry, row)` and an example of the carry, all scalars.

    **Returns:** the new body, on `(carry, kept)`, and the first `kept`.
    """
    leaves, treedef = jax.tree.flatten(carry)

    def flat_body(*arguments):
        after, row = body(jax.tree.unflatten(treedef, arguments))
        return [*jax.tree.leaves(after), row]

    closed = jax.make_jaxpr(flat_body)(*leaves)
    # without this, unused values would be kept too
    pruned, _ = partial_eval.dce_jaxpr(
        closed.jaxpr, [True] * (len(leaves) + 1), instantiate=True
    )
    kept = _chosen(pruned)
    shown = closed.replace(
        jaxpr=pruned.replace(
            outvars=[*pruned.outvars, *kept],
            debug_info=pruned.debug_info.with_unknown_names(),
        )
    )
    number = len(leaves)

    def whole(arguments):
        state, _ = arguments
        outputs = jaxpr_as_fun(shown)(*jax.tree.leaves(state))
        after = jax.tree.unflatten(treedef, outputs[:number])
        return (after, outputs[number + 1 :]), outputs[number]

    return whole, [jnp.zeros((), v.aval.dtype) for v in kept]


def depend_on(value, kept):
    """`value`, in a way that needs all kept scalars, which else would be dropped.

    Adding 1e-300 changes no number that a count can be.
    """
    total = jnp.zeros(())
    for v in kept:
        total = total + v.astype(jnp.float64)
    total = jax.lax.stop_gradient(total)
    return jnp.where(total == 1.2345678901e-301, value + 1e-300, value)
