"""Forward derivatives as products with one Jacobian, however many are asked for."""

from collections.abc import Callable

import equinox as eqx
import jax
from jax.flatten_util import ravel_pytree


def with_one_jacobian(
    function: Callable, finish: Callable = lambda by_each: by_each
) -> Callable:
    """`function`, whose derivative is its Jacobian by all numbers times the direction.

    So a chain of flights costs as much as its flights and not as their square. Can be
    differentiated again, unless `finish`, which gets the Jacobian, refuses.

    **Arguments:** a function of pytrees by place, and of what is static by name, that
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
