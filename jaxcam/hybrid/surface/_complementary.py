"""Solve small linear complementarity problems by trying all active sets."""

import itertools

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


# an active set with a pivot below this is redundant; the diagonal of the matrix is one
_REDUNDANT = 1e-12


def complementary(
    matrix: Float[Array, "m m"], right: Float[Array, " m"], closed: Bool[Array, " m"]
) -> Float[Array, " m"]:
    """Return p >= 0 with right + matrix p >= 0, where one of the two is zero for each
    unknown.

    Of the 2^m active sets, the one is chosen for which the smallest of all these values
    is largest, so that rounding errors do not exclude the solution. The loops are
    unrolled, so that all operations on a batch of such problems are elementwise.

    **Arguments:**

    - `matrix`: its diagonal is one, and its principal minors are not negative.
    - `closed`: which unknowns take part; for the others, p is zero without a condition.
    """
    number = right.shape[0]
    best, found = jnp.asarray(-jnp.inf), jnp.zeros_like(right)
    for size in range(number + 1):
        for active in itertools.combinations(range(number), size):
            values, valid = _solved(matrix, right, active)
            for k in active:
                valid = valid & closed[k]
            least = jnp.asarray(jnp.inf)
            for k in range(number):
                if k in active:
                    own = values[active.index(k)]
                else:
                    own = right[k]
                    for i, value in zip(active, values, strict=True):
                        own = own + matrix[k, i] * value
                least = jnp.where(closed[k], jnp.minimum(least, own), least)
            better = valid & (least > best)
            best = jnp.where(better, least, best)
            zero = jnp.zeros_like(right[0])
            whole = [
                values[active.index(k)] if k in active else zero for k in range(number)
            ]
            found = jnp.where(better, jnp.stack(whole), found)
    return found


def _solved(matrix, right, active):
    """Return the solution of right + matrix p = 0 for the active unknowns, and whether
    it is unique; elimination without pivoting.
    """
    rows = [[matrix[i, k] for k in active] for i in active]
    values, valid = [-right[i] for i in active], jnp.asarray(True)
    size = len(active)
    for p in range(size):
        regular = rows[p][p] > _REDUNDANT
        valid = valid & regular
        rows[p][p] = jnp.where(regular, rows[p][p], 1.0)
        for i in range(p + 1, size):
            factor = rows[i][p] / rows[p][p]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[p], strict=True)]
            values[i] = values[i] - factor * values[p]
    for p in reversed(range(size)):
        for k in range(p + 1, size):
            values[p] = values[p] - rows[p][k] * values[k]
        values[p] = values[p] / rows[p][p]
    return values, valid
