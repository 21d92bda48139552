"""Compute any number of forward derivatives as products with one Jacobian."""

from collections.abc import Callable

import equinox as eqx
import jax
from jax.flatten_util import ravel_pytree


def with_one_jacobian(
    function: Callable, finish: Callable = lambda by_each: by_each
) -> Callable:
    """Wrap `function` so that its derivative is the full Jacobian times the direction.

    The cost for a chain of flights is then proportional to their number instead of its
    square. The result can be differentiated again, unless `finish`, which receives the
    Jacobian, raises an error.

    **Arguments:** a function of positional pytrees and static keyword arguments that
    returns one array.
    """

    @eqx.filter_custom_jvp
    def call(*arguments, **static):
        return function(*arguments, **static)

    @call.def_jvp
    def _(primals, tangents, **static):
        leaves, treedef = jax.tree.flatten(primals)
        dots = jax.tree.leaves(tangents, is_leaf=lambda x: x is None)
        moving = [i for i, dot in enumerate(dots) if dot is not None]
        local, parts = ravel_pytree([leaves[i] for i in moving])
        direction, _ = ravel_pytree([dots[i] for i in moving])

        def moved(vector):
            new = list(leaves)
            for i, leaf in zip(moving, parts(vector), strict=True):
                new[i] = leaf
            value = function(*jax.tree.unflatten(treedef, new), **static)
            return value, value

        by_each, value = jax.jacfwd(moved, has_aux=True)(local)
        return value, finish(by_each) @ direction

    return call
