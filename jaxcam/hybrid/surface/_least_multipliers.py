"""When the contacts of a body on redundant supports end.

The force at a redundant support may be zero, or even negative by convention, while
others hold the body. A support is left only when no distribution of forces remains in
which all supports push and this one carries a load.
"""

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ._masked import null_vector


# An element of a null vector below this fraction of the largest is a rounding error
_ZERO = 1e-9


def least_multipliers(
    matrix: Float[Array, "m m"],
    multipliers: Float[Array, " m"],
    contact: Bool[Array, " m"],
) -> Float[Array, " m"]:
    """Return the multiplier of the largest load of each contact among all solutions in
    which all supports push; it rises through zero when the contact ends.

    Each is that of a different solution, so together they are not in equilibrium. The
    multipliers are returned unchanged unless exactly one support is redundant.

    **Arguments:** the changes of the normal accelerations (rows) by the multipliers
    (columns); the multipliers of the contact forces, negative if compressive; and which
    constraints are in contact.
    """
    null = null_vector(matrix, contact)
    size = jnp.max(jnp.abs(null))
    up, down = null > _ZERO * size, null < -_ZERO * size
    steps = -multipliers / jnp.where(up | down, null, 1.0)
    most = jnp.min(jnp.where(up, steps, jnp.inf))
    least = jnp.max(jnp.where(down, steps, -jnp.inf))
    # if no sign is missing, the solutions end at two vertices
    both = jnp.any(up) & jnp.any(down)
    found = jnp.where(up, multipliers + jnp.where(both, least, 0.0) * null, multipliers)
    return jnp.where(down, multipliers + jnp.where(both, most, 0.0) * null, found)
