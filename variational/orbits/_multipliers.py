"""Compute eigenvalues of a monodromy matrix with possibly very large entries."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float


def eigenvalues(
    matrix: Float[Array, "n n"], determinant: Float[Array, ""] | None = None
) -> Complex[Array, " n"]:
    """Return the eigenvalues of a real matrix, largest modulus first.

    Near grazing, the entries grow like the inverse of the impact speed, while the
    determinant remains bounded. For n = 2, the larger root of mu^2 - trace mu + det is
    computed without cancellation, and the smaller one is det divided by it, so that
    both are accurate if `determinant` is known more accurately than from the entries.

    Args:
        matrix: A real matrix, shape `(n, n)`.
        determinant: Determinant of the matrix, if known more accurately.

    Returns:
        Shape `(n,)`, complex.

    Examples:
        >>> from variational.orbits import eigenvalues
        >>> large = jnp.array([[1e15, 1e15], [-0.5, -0.5 + 0.64e-15]])
        >>> f"{eigenvalues(large)[1].real:.3e}"
        '6.875e-16'
        >>> f"{eigenvalues(large, jnp.array(0.64))[1].real:.3e}"
        '6.400e-16'
    """
    if matrix.shape[0] == 2:
        return _two(matrix, determinant)
    found = jnp.linalg.eigvals(matrix)
    return found[jnp.argsort(-jnp.abs(found))]


def _two(matrix, determinant):
    (a, b), (c, d) = matrix
    det = a * d - b * c if determinant is None else determinant
    half = (a + d) / 2
    square = half * half - det
    real = square >= 0
    root = jnp.sqrt(jnp.where(real, square, 0.0))
    large = half + jnp.where(half < 0, -root, root)
    small = jnp.where(large == 0, 0.0, det / jnp.where(large == 0, 1.0, large))
    width = jnp.sqrt(jnp.where(real, 0.0, -square))
    first = jax.lax.complex(jnp.where(real, large, half), width)
    second = jax.lax.complex(jnp.where(real, small, half), -width)
    return jnp.stack([first, second])
