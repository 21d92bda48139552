"""Keep shared intermediate values of a loop body in memory.

The compiler fuses cheap operations into the operations that use them, and recomputes a
shared value in each of its users. In a long body, such repetitions multiply until one
iteration takes a hundred times as long as necessary, both to run and to compile. A
value that the loop carries from iteration to iteration must exist in memory, so its
users read it instead. This pass finds the values worth carrying. The results of the
loop are not changed.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax.core import eval_jaxpr
from jax.extend.core import jaxpr_as_fun, Literal
from jax.interpreters import partial_eval

from ._jaxprs import calls_library


# a value is kept if recomputing it wherever it is used would take at least this many
# operations
_THRESHOLD = 100
# operations that cost more than an addition
_COST = {"div": 4, "sqrt": 6, "custom_jvp_call": 40, "sin": 30, "cos": 30, "pow": 40}
_COST |= {"exp": 20, "log": 20, "atan2": 30, "atan": 20, "asin": 30, "acos": 30}


def _chosen(jaxpr) -> list:
    """Return the variables of a jaxpr that are worth keeping."""
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
        # inputs of the body and kept values have no further cost
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


def _hoisted(jaxpr, constants):
    """Return a program in which all operations on constants have been evaluated."""
    known = set(jaxpr.constvars)
    early, late = [], []
    for equation in jaxpr.eqns:
        inputs = [v for v in equation.invars if not isinstance(v, Literal)]
        fixed = all(v in known for v in inputs) and not equation.effects
        (early if fixed else late).append(equation)
        if fixed:
            known.update(equation.outvars)
    needed = {v for e in late for v in e.invars if not isinstance(v, Literal)}
    needed |= {v for v in jaxpr.outvars if not isinstance(v, Literal)}
    made = [v for e in early for v in e.outvars if v in needed]
    plain = jaxpr.debug_info.with_unknown_names()
    first = jaxpr.replace(
        invars=[], outvars=made, eqns=early, debug_info=plain, effects=set()
    )
    values = eval_jaxpr(first, constants)
    rest = jaxpr.replace(
        constvars=[*jaxpr.constvars, *made], eqns=late, debug_info=plain
    )
    return rest, [*constants, *values]


def with_kept(body: Callable, carry, on: bool = True):
    """Return a loop body that also carries its shared scalars.

    **Arguments:** `body(carry) -> (carry, row)`, and an example of the carry, a pytree
    of scalars. The row may be a pytree. If `on` is false, nothing is kept.

    Returns:
        The new body, a function of `(carry, kept)`, and the initial `kept`.
    """
    if not on:
        return functools.partial(_keeping_nothing, body), []
    leaves, treedef = jax.tree.flatten(carry)

    def flat_body(*arguments):
        return body(jax.tree.unflatten(treedef, arguments))

    closed, shape = jax.make_jaxpr(flat_body, return_shape=True)(*leaves)
    outputs = jax.tree.structure(shape)
    # otherwise, unused values would also be kept
    pruned, _ = partial_eval.dce_jaxpr(
        closed.jaxpr, [True] * outputs.num_leaves, instantiate=True
    )
    rest, constants = _hoisted(pruned, closed.consts)
    kept = _chosen(rest)
    shown = closed.replace(
        jaxpr=rest.replace(outvars=[*rest.outvars, *kept]), consts=constants
    )
    number = outputs.num_leaves

    def whole(arguments):
        state, _ = arguments
        made = jaxpr_as_fun(shown)(*jax.tree.leaves(state))
        after, row = jax.tree.unflatten(outputs, made[:number])
        return (after, made[number:]), row

    return whole, [jnp.zeros((), v.aval.dtype) for v in kept]


def _keeping_nothing(body, state):
    after, row = body(state[0])
    return (after, []), row


def without_library(function: Callable, argument):
    """Evaluate the library calls of `function` in advance if they do not depend on its
    argument.

    A loop that calls a library cannot be a single kernel. A function without library
    calls is not changed: its operations on constants cost less within the kernel than
    their results as its arguments.
    """
    leaves, treedef = jax.tree.flatten(argument)

    def flat(*leaves):
        return function(jax.tree.unflatten(treedef, leaves))

    closed, shape = jax.make_jaxpr(flat, return_shape=True)(*leaves)
    program = closed
    if calls_library(closed.jaxpr):
        rest, constants = _hoisted(closed.jaxpr, closed.consts)
        program = closed.replace(jaxpr=rest, consts=constants)

    def called(argument):
        made = jaxpr_as_fun(program)(*jax.tree.leaves(argument))
        return jax.tree.unflatten(jax.tree.structure(shape), made)

    return called


def depend_on(value, kept):
    """Return `value`, a count, made to depend on all kept scalars, so that the compiler
    computes all of them.

    Adding 1e-300 does not change any possible count.
    """
    total = jnp.zeros(())
    for v in kept:
        total = total + v.astype(jnp.float64)
    total = jax.lax.stop_gradient(total)
    return jnp.where(total == 1.2345678901e-301, value + 1e-300, value)
