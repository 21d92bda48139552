"""Bound the impulses of restitution at several contacts by the energy."""

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


# products of coefficients of influence below this are rounding errors
_UNCOUPLED = 1e-24


def restitution_bound(
    matrix: Float[Array, "k k"],
    before: Float[Array, " k"],
    pressed: Float[Array, " k"],
    back: Float[Array, " k"],
    coefficients: Float[Array, " k"],
) -> Float[Array, " k"]:
    """Return the factor, at most one, by which each impulse of restitution must be
    multiplied so that it does not return too much energy.

    Impulses that influence each other may together return the energy that they lost in
    compression, times the square of their largest coefficient of restitution.

    **Arguments:** the changes of all velocities by unit impulses; the velocities before
    the impact; the impulses of compression and of restitution; and the coefficients of
    restitution, zero where there is none.
    """
    weights, coupled = _inverse_mass_ratios(matrix)
    between = before + matrix @ pressed
    # energies in a common unit, of the impulses that influence each other
    lost = -weights @ (pressed * (before + between)) / 2
    linear = weights @ (back * between)
    square = weights @ (back * (matrix @ back)) / 2
    counts = coupled & (pressed != 0)[None, :]
    largest = jnp.max(jnp.where(counts, coefficients[None, :], 0.0), axis=1)
    most = jnp.maximum(largest * largest * lost, 0.0)
    exceeds = (linear + square > most) & (square > 0)
    inside = linear * linear + 4 * square * most
    root = jnp.sqrt(jnp.where(exceeds & (inside > 0), inside, 1.0))
    root = jnp.where(inside > 0, root, 0.0)
    # the share of the impulses at which the energy reaches its bound, computed without
    # cancellation
    rises = exceeds & (linear > 0)
    share = jnp.where(
        rises,
        2 * most / jnp.where(rises, linear + root, 1.0),
        (root - linear) / jnp.where(exceeds, 2 * square, 1.0),
    )
    return jnp.where(exceeds, share, 1.0)


def _inverse_mass_ratios(
    matrix: Float[Array, "k k"],
) -> tuple[Float[Array, "k k"], Bool[Array, "k k"]]:
    """Return the ratios of the inverse masses of the impulses, zero for pairs that do
    not influence each other; and which pairs do, even if only through other impulses.

    With the inverse masses m, the matrix G satisfies G_ab / m_a = G_ba / m_b.
    """
    number = len(matrix)
    itself = jnp.eye(number, dtype=bool)
    coupled = itself | (jnp.abs(matrix * matrix.T) > _UNCOUPLED)
    others = coupled & ~itself
    ratios = jnp.where(others, matrix, 0.0) / jnp.where(others, matrix.T, 1.0)
    ratios = jnp.where(itself, 1.0, ratios)
    for k in range(number):
        path = coupled[:, k, None] & coupled[None, k] & ~coupled
        longer = ratios[:, k, None] * ratios[None, k]
        ratios = jnp.where(path, longer, ratios)
        coupled = coupled | path
    return ratios, coupled
