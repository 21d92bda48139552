"""Find roots by Newton's method, with derivatives from the implicit function
theorem.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


_STEPS = 60
# a residual of this size may be rounding error
_ROUNDING = 1e-10


def implicit_root(
    residual: Callable[[Float[Array, " n"]], Float[Array, " n"]],
    guess: Float[Array, " n"],
) -> Float[Array, " n"]:
    """Find the root of `residual` near `guess`, with exact derivatives.

    The method is Newton's, with steps halved until the residual decreases. The
    derivative with respect to everything that `residual` closes over follows from the
    implicit function theorem. The function works under `jit`, `vmap`, `jvp` and `vjp`.

    Args:
        residual: Function whose root is to be found, from shape `(n,)` to `(n,)`.
        guess: Start of the iteration, shape `(n,)`.

    Returns:
        The root, shape `(n,)`; NaN if Newton's method does not converge.

    Examples:
        >>> from variational.orbits import implicit_root
        >>> root = lambda p: implicit_root(lambda x: x**2 - p, jnp.array([1.0]))[0]
        >>> round(float(root(2.0)), 6), round(float(jax.grad(root)(2.0)), 6)
        (1.414214, 0.353553)
    """

    def newton(function, start):
        # call the function at one place only, because tracing and compiling it takes
        # most of the time
        def twice(x):
            value = function(x)
            return value, value

        def both(x):
            return jax.jacfwd(twice, has_aux=True)(x)

        def size(value):
            norm = jnp.max(jnp.abs(value))
            return jnp.where(jnp.isfinite(norm), norm, jnp.inf)

        def unfinished(carry):
            return (carry[0] < _STEPS) & ~carry[-1]

        def one(carry):
            count, x, change, best, share, _ = carry
            trial = x - share * change
            jacobian, value = both(trial)
            here = size(value)
            better = here < best
            following = jnp.linalg.solve(jacobian, value)
            limit = 1e-13 * (1 + jnp.max(jnp.abs(trial)))
            # at rounding level, the residual stops decreasing
            settled = (jnp.max(jnp.abs(share * change)) <= limit) & (count > 0)
            small = jnp.max(jnp.abs(following)) <= limit
            done = (better & small) | (settled & (best <= _ROUNDING))
            x = jnp.where(better, trial, x)
            change = jnp.where(better, following, change)
            share = jnp.where(better, jnp.minimum(1.0, 2 * share), 0.5 * share)
            return count + 1, x, change, jnp.where(better, here, best), share, done

        first = (
            jnp.asarray(0),
            start,
            jnp.zeros_like(start),
            jnp.asarray(jnp.inf),
            jnp.asarray(1.0),
            jnp.asarray(False),
        )
        _, x, change, _, _, done = jax.lax.while_loop(unfinished, one, first)
        return jnp.where(done, x - change, jnp.nan)

    def tangent(linear, right):
        return jnp.linalg.solve(jax.jacfwd(linear)(right), right)

    return jax.lax.custom_root(residual, guess, newton, tangent)
