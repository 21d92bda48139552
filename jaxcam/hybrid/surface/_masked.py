"""Solve small linear systems for some of their unknowns."""

from typing import NamedTuple

import jax.numpy as jnp


# Smallest number of supports that may be redundant, apart from two at the same place
FEW = 3
# A pivot below this fraction of its diagonal element belongs to a redundant row
_REDUNDANT = 1e-10


def solve_masked(matrix, right, mask):
    """Return the solution for the masked unknowns, zero elsewhere.

    If a body has more supports than its equilibrium determines (it is statically
    indeterminate), the matrix is singular. Of all solutions, the one in the range of
    the matrix is returned: forces are distributed as if every support were a spring
    with the same natural frequency.

    The diagonal of the matrix must not be zero where the mask holds, because the
    elimination has no pivoting. The elimination is unrolled, because the matrix is
    small (a row for each constraint or surface); a batch then stays elementwise.
    """
    made = _eliminated(matrix, right, mask)
    found = _substituted(made.rows, made.values)
    return _projected(found, [(left, right) for _, left, right in made.free])


def null_vector(matrix, mask):
    """Return a vector that the masked part of a matrix maps to zero, and the number of
    independent vectors of this kind; if there is none, return zeros.
    """
    made = _eliminated(matrix, jnp.zeros(matrix.shape[0]), mask)
    number, found = jnp.zeros(()), jnp.zeros(matrix.shape[0])
    for small, _, right in made.free:
        found, number = found + right, number + jnp.where(small, 1.0, 0.0)
    return found, number


class _Eliminated(NamedTuple):
    """A triangular system: its rows, and the values on the right. For each unknown
    but the first, whether it is redundant, and left and right null vectors, of which
    the latter is zero if not.
    """

    rows: list
    values: list
    free: list


def _eliminated(matrix, right, mask) -> _Eliminated:
    number = right.shape[0]
    zero, one = jnp.zeros(()), jnp.ones(())
    # behind the elements of the matrix: the combination of rows that a row has become
    rows = [
        [
            *(
                jnp.where(mask[i] & mask[k], matrix[i, k], one if i == k else zero)
                for k in range(number)
            ),
            *(one if i == k else zero for k in range(number)),
        ]
        for i in range(number)
    ]
    diagonal = [rows[p][p] for p in range(number)]
    values = [jnp.where(mask[i], right[i], zero) for i in range(number)]
    redundant = []
    for p in range(number):
        if p and number >= FEW:
            small = jnp.abs(rows[p][p]) <= _REDUNDANT * jnp.abs(diagonal[p])
            redundant.append((p, small, jnp.stack(rows[p][number:])))
            for k in range(number):
                rows[p][k] = jnp.where(small, one if k == p else zero, rows[p][k])
            values[p] = jnp.where(small, zero, values[p])
        for i in range(p + 1, number):
            factor = rows[i][p] / rows[p][p]
            if p and number >= FEW:
                # a redundant row eliminates nothing
                factor = jnp.where(redundant[-1][1], zero, factor)
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[p], strict=True)]
            values[i] = values[i] - factor * values[p]
    free = []
    for p, small, left in redundant:
        unit = [jnp.where(small, one, zero) if k == p else zero for k in range(number)]
        for k in range(p + 1, number):
            unit[k] = jnp.where(small, -rows[k][p], zero)
        free.append((small, left, _substituted(rows, unit)))
    return _Eliminated(rows, values, free)


def _substituted(rows, values):
    """Return the solution of a triangular system."""
    values = list(values)
    for p in reversed(range(len(values))):
        for k in range(p + 1, len(values)):
            values[p] = values[p] - rows[p][k] * values[k]
        values[p] = values[p] / rows[p][p]
    return jnp.stack(values)


def _projected(vector, pairs):
    """Return a vector without its part along right null vectors, such that it has no
    part along left ones.

    **Arguments:** the vector; pairs of a left and a right null vector, of which the
    right one may be zero: it is then no pair.
    """
    done = []
    for left, right in pairs:
        for other, along, product in done:
            left, right = (
                left - (left @ along) / product * other,
                right - (other @ right) / product * along,
            )
        product = left @ right
        product = jnp.where(product == 0, jnp.ones_like(product), product)
        vector = vector - (left @ vector) / product * right
        done.append((left, right, product))
    return vector
