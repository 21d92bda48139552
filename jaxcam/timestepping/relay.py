"""Linear systems with ideal relays, and the problem of one time step."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from .complementarity import lemke, Pivoting


_LARGEST = 14


def _matrix(value) -> jax.Array:
    return jnp.atleast_2d(jnp.asarray(value, dtype=float))


class RelaySystem(eqx.Module):
    """Linear system with relays: x' = A x + B u, y = C x + D u, where each u_i is the
    output of a relay controlled by y_i.

    The relay output u_i, which is an input of the linear system, is 1 for y_i < 0, -1
    for y_i > 0, and any value in between for y_i = 0, as sliding requires (thesis, eq.
    3.1). D is zero by default.

    Raises:
        ValueError: The shapes are inconsistent.

    Examples:
        >>> from jaxcam.timestepping import RelaySystem
        >>> RelaySystem([[-1.0]], [[1.0]], [[1.0]]).D.shape
        (1, 1)
    """

    A: Float[Array, "n n"]
    """Shape `(n, n)`."""
    B: Float[Array, "n m"]
    """Shape `(n, m)`."""
    C: Float[Array, "m n"]
    """Shape `(m, n)`."""
    D: Float[Array, "m m"]
    """Shape `(m, m)`."""

    def __init__(self, A, B, C, D=None):
        self.A, self.B, self.C = _matrix(A), _matrix(B), _matrix(C)
        m = self.C.shape[0]
        self.D = jnp.zeros((m, m)) if D is None else _matrix(D)
        n = self.A.shape[0]
        shapes = [a.shape for a in (self.A, self.B, self.C, self.D)]
        if shapes != [(n, n), (n, m), (m, n), (m, m)]:
            raise ValueError(
                "Give A (n, n), B (n, m), C (m, n) and D (m, m): their shapes are "
                f"{', '.join(map(str, shapes))}."
            )


def relay_problem(
    matrix: Float[Array, "m m"], vector: Float[Array, " m"]
) -> tuple[Float[Array, " m"], Float[Array, " m"], Pivoting]:
    """Solve y = M u + q, where each u_i is the output of a relay controlled by y_i
    (thesis, eq. 3.3).

    This is a complementarity problem of twice the size, between 1 + u and the positive
    part of y, and between 1 - u and the negative part of y. Because u is bounded, the
    problem always has a solution; the solution is unique if M is a P-matrix.

    Args:
        matrix: M, shape `(m, m)`.
        vector: q, shape `(m,)`.

    Returns:
        u and y, both of shape `(m,)`, and the result of Lemke's method.

    Examples:
        >>> from jaxcam.timestepping.relay import relay_problem
        >>> u, y, _ = relay_problem(jnp.array([[0.5]]), jnp.array([-0.2]))
        >>> round(float(u[0]), 6), abs(float(y[0])) < 1e-12  # sliding: 0.5 u - 0.2 = 0
        (0.4, True)
        >>> u, y, _ = relay_problem(jnp.array([[0.5]]), jnp.array([2.0]))
        >>> round(float(u[0]), 6), round(float(y[0]), 6)
        (-1.0, 1.5)
    """
    m = vector.shape[0]
    eye = jnp.eye(m, dtype=vector.dtype)
    block = jnp.block([[matrix, eye], [-eye, jnp.zeros_like(eye)]])
    one = jnp.ones_like(vector)
    found = lemke(block, jnp.concatenate([vector - matrix @ one, 2 * one]))
    u = jnp.clip(found.z[:m] - 1, -1.0, 1.0)
    return u, matrix @ u + vector, found


def is_p_matrix(matrix: Float[ArrayLike, "m m"]) -> bool:
    """Return whether all principal minors are positive, so that the linear
    complementarity problem has a unique solution for every vector q.

    Args:
        matrix: Shape `(m, m)`.

    Returns:
        Whether it is a P-matrix.

    Raises:
        ValueError: The matrix has more than 14 rows; there are 2^m minors.

    Examples:
        >>> from jaxcam.timestepping.relay import is_p_matrix
        >>> triangular = jnp.array([[1.0, 2.0], [0.0, 1.0]])
        >>> is_p_matrix(triangular), is_p_matrix(triangular + triangular.T)
        (True, False)
    """
    values = np.asarray(matrix)
    m = values.shape[0]
    if m > _LARGEST:
        raise ValueError(
            f"There are 2^{m} principal minors, too many to check; divide the system "
            "into parts that do not act on each other."
        )
    for mask in range(1, 2**m):
        rows = [i for i in range(m) if mask >> i & 1]
        if not np.linalg.det(values[np.ix_(rows, rows)]) > 0:
            return False
    return True
