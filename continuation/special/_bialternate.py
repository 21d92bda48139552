"""Compute second compound matrices, which are singular if a pair of eigenvalues is
critical.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def pairs(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices i < j of the n(n-1)/2 pairs."""
    return np.triu_indices(n, k=1)


def additive(a: Float[Array, "n n"]) -> Float[Array, "m m"]:
    """Return twice the bialternate product of A and I; its eigenvalues are the sums
    l_i + l_j, i < j, of the eigenvalues of A.

    See Kuznetsov, Elements of Applied Bifurcation Theory, section 10.2.
    """
    i, j = pairs(a.shape[0])
    one = jnp.eye(a.shape[0], dtype=a.dtype)
    return (
        a[np.ix_(i, i)] * one[np.ix_(j, j)]
        + one[np.ix_(i, i)] * a[np.ix_(j, j)]
        - a[np.ix_(i, j)] * one[np.ix_(j, i)]
        - one[np.ix_(i, j)] * a[np.ix_(j, i)]
    )


def multiplicative(a: Float[Array, "n n"]) -> Float[Array, "m m"]:
    """Return the bialternate product of A with itself; its eigenvalues are the products
    l_i l_j, i < j, of the eigenvalues of A.
    """
    i, j = pairs(a.shape[0])
    return a[np.ix_(i, i)] * a[np.ix_(j, j)] - a[np.ix_(i, j)] * a[np.ix_(j, i)]


def plane(w: Float[Array, " m"], n: int) -> Float[Array, "n n"]:
    """Return the antisymmetric matrix with the entries of w above its diagonal.

    If w is an eigenvector of a compound matrix, the range of the result is the
    invariant plane of the pair of eigenvalues to which w belongs.
    """
    i, j = pairs(n)
    upper = jnp.zeros((n, n), w.dtype).at[i, j].set(w)
    return upper - upper.T


def trace_on_plane(a: Float[Array, "n n"], w: Float[Array, " m"]):
    """Return l_i + l_j of the pair of eigenvalues with the invariant plane w."""
    p = plane(w, a.shape[0])
    return jnp.sum(p * (a @ p + p @ a.T)) / jnp.sum(p * p)


def determinant_on_plane(a: Float[Array, "n n"], w: Float[Array, " m"]):
    """Return l_i l_j of the pair of eigenvalues with the invariant plane w."""
    p = plane(w, a.shape[0])
    return jnp.sum(p * (a @ p @ a.T)) / jnp.sum(p * p)
