"""Solve small linear systems for some of their unknowns."""

import jax.numpy as jnp


def solve_masked(matrix, right, mask):
    """Return the solution for the masked unknowns, zero elsewhere.

    The diagonal of the matrix must not be zero where the mask holds, because the
    elimination has no pivoting. The elimination is unrolled, because the matrix is
    small (a row for each constraint or surface); a batch then stays elementwise.
    """
    number = right.shape[0]
    rows = [
        [
            jnp.where(mask[i] & mask[k], matrix[i, k], jnp.asarray(float(i == k)))
            for k in range(number)
        ]
        for i in range(number)
    ]
    values = [
        jnp.where(mask[i], right[i], jnp.zeros_like(right[i])) for i in range(number)
    ]
    for p in range(number):
        for i in range(p + 1, number):
            factor = rows[i][p] / rows[p][p]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[p], strict=True)]
            values[i] = values[i] - factor * values[p]
    for p in reversed(range(number)):
        for k in range(p + 1, number):
            values[p] = values[p] - rows[p][k] * values[k]
        values[p] = values[p] / rows[p][p]
    return jnp.stack(values)
