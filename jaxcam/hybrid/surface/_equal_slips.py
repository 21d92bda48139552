"""Solve for the weights of sliding if several surfaces have the same slip velocity.

The feet of a rigid body that rests flat on a floor slip at the same velocity. Their
friction forces are then statically indeterminate: only the sum is determined. It is
divided in proportion to the forces during slip, so all feet begin to slip at the same
instant. The same applies to surfaces with proportional slip velocities, such as those
at the two ends of a ladder.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ._masked import solve_masked


# two surfaces have the same slip velocity if the determinant of their gains is below
# this fraction of the product of the diagonal
_EQUAL = 1e-9


class Tie(NamedTuple):
    """Two surfaces, and whether the slip velocity of the second is proportional to that
    of the first, with a positive or negative factor (`sign`); a surface is tied only to
    the first such surface.
    """

    first: int
    second: int
    equal: Bool[Array, ""]
    sign: Float[Array, ""]


def ties(gains, mask) -> list[Tie]:
    """Return the ties between the masked surfaces.

    **Arguments:** the changes of the slopes (rows) by the weights (columns).
    """
    found = []
    for p in range(1, len(gains)):
        follows = jnp.asarray(False)
        for q in range(p):
            product = gains[q, q] * gains[p, p]
            rest = product - gains[q, p] * gains[p, q]
            equal = mask[p] & mask[q] & (jnp.abs(rest) <= _EQUAL * jnp.abs(product))
            now, follows = equal & ~follows, follows | equal
            sign = jnp.where(gains[q, p] * gains[q, q] < 0, -1.0, 1.0)
            found.append(Tie(q, p, now, sign))
    return found


def solve_equal_slips(gains, right, mask, shift):
    """Return the solution for the masked unknowns, zero elsewhere.

    Of two surfaces with the same slip velocity, the second has the weight of the first.
    Weights are measured from `shift` / 2, the middle between the sides:
    b_2 - shift / 2 = s (b_1 - shift / 2), where s = -1 if the two slip velocities have
    opposite signs.

    **Arguments:** the changes of the slopes (rows) by the weights (columns), the wanted
    changes, the surfaces on which the motion slides, and 1, or 0 if the unknowns are
    changes of weights.
    """
    number = right.shape[0]
    if number == 1:
        return solve_masked(gains, right, mask)
    rows = [[gains[i, k] for k in range(number)] for i in range(number)]
    values = [right[i] for i in range(number)]
    for q, p, equal, sign in ties(gains, mask):
        tied = [jnp.asarray(float(k == p)) for k in range(number)]
        tied[q] = -sign
        pairs = zip(tied, rows[p], strict=True)
        rows[p] = [jnp.where(equal, a, b) for a, b in pairs]
        values[p] = jnp.where(equal, shift * (1 - sign) / 2, values[p])
    matrix = jnp.stack([jnp.stack(row) for row in rows])
    return solve_masked(matrix, jnp.stack(values), mask)
