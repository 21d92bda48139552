"""When the contacts of a body on redundant supports end.

The force at a redundant support may be zero, or even negative by convention, while
others hold the body. A support is left only when no distribution of forces remains in
which all supports push and this one carries a load.
"""

import itertools

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ._masked import null_vector


# An element of a null vector below this fraction of the largest is a rounding error
_ZERO = 1e-9
# Smallest number of supports of which two may be needed and several redundant
_PAIRS = 4
# Two supports do not hold a body if their determinant is below this fraction of the
# product of the diagonal
_PARALLEL = 1e-9


def least_multipliers(
    matrix: Float[Array, "m m"],
    multipliers: Float[Array, " m"],
    contact: Bool[Array, " m"],
) -> Float[Array, " m"]:
    """Return the multiplier of the largest load of each contact among all solutions in
    which all supports push; it rises through zero when the contact ends.

    Each is that of a different solution, so together they are not in equilibrium. The
    multipliers are returned unchanged if no support is redundant, and also if several
    are redundant unless two supports are needed to hold the body.

    **Arguments:** the changes of the normal accelerations (rows) by the multipliers
    (columns); the multipliers of the contact forces, negative if compressive; and which
    constraints are in contact.
    """
    null, redundant = null_vector(matrix, contact)
    found = jnp.where(redundant == 1, _at_ends(null, multipliers), multipliers)
    if len(multipliers) < _PAIRS:
        return found
    needed = jnp.sum(jnp.where(contact, 1.0, 0.0)) - redundant
    pairs = _on_pairs(matrix, multipliers, contact)
    return jnp.where((redundant > 1) & (needed == 2), pairs, found)


def _at_ends(null, multipliers):
    """Return the least multipliers among all sums with a multiple of a null vector."""
    size = jnp.max(jnp.abs(null))
    up, down = null > _ZERO * size, null < -_ZERO * size
    steps = -multipliers / jnp.where(up | down, null, 1.0)
    most = jnp.min(jnp.where(up, steps, jnp.inf))
    least = jnp.max(jnp.where(down, steps, -jnp.inf))
    # if no sign is missing, the solutions end at two vertices
    both = jnp.any(up) & jnp.any(down)
    found = jnp.where(up, multipliers + jnp.where(both, least, 0.0) * null, multipliers)
    return jnp.where(down, multipliers + jnp.where(both, most, 0.0) * null, found)


def _on_pairs(matrix, multipliers, contact):
    """Return the least multipliers among the solutions on two supports.

    If no pair pushes at both supports, the body leaves all but the one that is most
    loaded in the best pair; the multipliers are then those on pairs with this support.
    """
    total, number = matrix @ multipliers, len(multipliers)
    pairs = []
    greatest, last = jnp.asarray(-jnp.inf), jnp.asarray(0)
    for i, k in itertools.combinations(range(number), 2):
        product = matrix[i, i] * matrix[k, k]
        det = product - matrix[i, k] * matrix[k, i]
        holds = contact[i] & contact[k] & (jnp.abs(det) > _PARALLEL * jnp.abs(product))
        det = jnp.where(holds, det, 1.0)
        loads = (
            (matrix[i, k] * total[k] - matrix[k, k] * total[i]) / det,
            (matrix[k, i] * total[i] - matrix[i, i] * total[k]) / det,
        )
        least = jnp.where(holds, jnp.minimum(*loads), -jnp.inf)
        better = least > greatest
        greatest = jnp.where(better, least, greatest)
        last = jnp.where(better, jnp.where(loads[0] > loads[1], i, k), last)
        pairs.append((i, k, loads, least))
    found = [jnp.asarray(-jnp.inf)] * number
    for i, k, loads, least in pairs:
        pushes = least >= 0
        counts = jnp.where(greatest >= 0, pushes, (last == i) | (last == k))
        for place, load in zip((i, k), loads, strict=True):
            own = jnp.where(counts & (least > -jnp.inf), load, -jnp.inf)
            found[place] = jnp.maximum(found[place], own)
    most = jnp.stack(found)
    return jnp.where(jnp.isfinite(most), -most, multipliers)
