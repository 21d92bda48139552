"""Solve linear complementarity problems by Lemke's method."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, Int

from ..hybrid.programs import program


# entries of the tableau below this fraction of the largest one are rounding errors
_TINY = 1e-12
# maximum number of pivots per row (plus 40): no vertex is visited twice, and only a few
# of the 2^m vertices are visited
_PIVOTS = 40

SOLVED, RAY, EXHAUSTED = 0, 1, 2


class Pivoting(NamedTuple):
    """The result of Lemke's method."""

    z: Float[Array, " m"]
    """The solution, shape `(m,)`."""
    w: Float[Array, " m"]
    """w = M z + q, shape `(m,)`."""
    code: Int[Array, ""]
    """0: solved; 1: ended on a ray (no solution found); 2: too many pivots."""


def lemke(matrix: Float[Array, "m m"], vector: Float[Array, " m"]) -> Pivoting:
    """Solve z >= 0, w = M z + q >= 0, z . w = 0; for use inside `jit`, `scan` and
    `vmap`.

    The method is Lemke's complementary pivoting with the lexicographic rule, which
    cannot cycle (R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity
    Problem, 1992, section 4.4). If M is copositive-plus, termination on a ray means
    that there is no solution; for other M, it means that no solution was found.

    Args:
        matrix: M, shape `(m, m)`.
        vector: q, shape `(m,)`.

    Returns:
        A [`jaxcam.timestepping.complementarity.Pivoting`][].

    Examples:
        >>> from jaxcam.timestepping.complementarity import lemke
        >>> matrix = jnp.array([[2.0, 1.0], [1.0, 2.0]])
        >>> found = lemke(matrix, jnp.array([-5.0, -7.0]))
        >>> np.asarray(found.z).round(6).tolist(), int(found.code)
        ([1.0, 3.0], 0)
    """
    m = vector.shape[0]
    one = jnp.ones(m, dtype=vector.dtype)
    eye = jnp.eye(m, dtype=vector.dtype)
    tableau = jnp.concatenate([eye, -matrix, -one[:, None], vector[:, None]], axis=1)
    artificial = 2 * m
    basis = jnp.arange(m)
    trivial = jnp.all(vector >= 0)

    # the artificial variable enters where q is most negative
    first = _least(jnp.concatenate([vector[:, None], eye], axis=1), one > 0, m)
    tableau = _pivot(tableau, first, artificial)
    basis = basis.at[first].set(artificial)

    def running(carry):
        _, _, _, code, count = carry
        return (code < 0) & (count < _PIVOTS * m + 40)

    def pivot(carry):
        tableau, basis, entering, _, count = carry
        column = tableau[:, entering]
        rises = column > _TINY * jnp.maximum(1.0, jnp.max(jnp.abs(column)))
        ray = ~jnp.any(rises)
        safe = jnp.where(rises, column, 1.0)
        rows = jnp.concatenate([tableau[:, -1:], tableau[:, :m]], axis=1)
        rows = rows / safe[:, None]
        row = _least(rows, rises, m)
        # the artificial variable leaves as soon as it can
        ratio = jnp.where(rises, rows[:, 0], jnp.inf)
        room = _TINY * jnp.maximum(1.0, jnp.abs(jnp.min(ratio)))
        out = (basis == artificial) & (ratio <= jnp.min(ratio) + room)
        row = jnp.where(jnp.any(out), jnp.argmax(out), row)
        leaving = basis[row]
        moved = _pivot(tableau, row, entering)
        tableau = jnp.where(ray, tableau, moved)
        basis = jnp.where(ray, basis, basis.at[row].set(entering))
        ended = jnp.where(ray, RAY, jnp.where(leaving == artificial, SOLVED, -1))
        following = jnp.where(leaving < m, leaving + m, leaving - m)
        return tableau, basis, following, ended, count + 1

    start = (tableau, basis, first + m, jnp.where(trivial, SOLVED, -1), 0)
    tableau, basis, _, code, _ = jax.lax.while_loop(running, pivot, start)
    values = jnp.zeros(2 * m + 1, dtype=vector.dtype).at[basis].set(tableau[:, -1])
    z = jnp.where(trivial, jnp.zeros_like(vector), values[m : 2 * m])
    code = jnp.where(code < 0, EXHAUSTED, code)
    return Pivoting(z, matrix @ z + vector, code)


def solve_lcp(
    matrix: Float[ArrayLike, "m m"], vector: Float[ArrayLike, " m"]
) -> Float[Array, " m"]:
    """Return the solution z of [`jaxcam.timestepping.complementarity.lemke`][].

    Args:
        matrix: M, shape `(m, m)`.
        vector: q, shape `(m,)`.

    Returns:
        The solution, shape `(m,)`.

    Raises:
        ValueError: Lemke's method finds no solution.

    Examples:
        >>> from jaxcam.timestepping.complementarity import solve_lcp
        >>> matrix = jnp.array([[2.0, 1.0], [1.0, 2.0]])
        >>> z = solve_lcp(matrix, jnp.array([-5.0, 1.0]))
        >>> np.asarray(z).round(6).tolist()  # w = (0, 3.5)
        [2.5, 0.0]
    """
    matrix = jnp.asarray(matrix, dtype=jnp.float64)
    vector = jnp.asarray(vector, dtype=jnp.float64)
    if matrix.shape != (vector.shape[0], vector.shape[0]):
        raise ValueError(
            f"Give a square matrix and a vector of the same size: their shapes are "
            f"{matrix.shape} and {vector.shape}."
        )
    found = _lemke(matrix, vector)
    explain(int(found.code))
    return found.z


_lemke = program(lemke)


def explain(code: int, where: str = "") -> None:
    """Raise `ValueError` for a code that is not SOLVED."""
    if code == RAY:
        raise ValueError(
            f"The complementarity problem{where} has no solution that Lemke's method "
            "can find: its matrix is not copositive-plus, and the pivots end on a ray; "
            "check the signs of the model, or use a shorter step."
        )
    if code == EXHAUSTED:
        raise ValueError(
            f"The complementarity problem{where} needs too many pivots; scale its rows "
            "to similar magnitudes."
        )


def _least(rows, allowed, m):
    """Return the lexicographically smallest of the allowed rows."""
    mask = allowed
    for k in range(m + 1):
        values = jnp.where(mask, rows[:, k], jnp.inf)
        least = jnp.min(values)
        room = _TINY * jnp.maximum(1.0, jnp.abs(least))
        mask = mask & (values <= jnp.where(jnp.isfinite(least), least + room, least))
    return jnp.argmax(mask)


def _pivot(tableau, row, column):
    scaled = tableau[row] / tableau[row, column]
    others = tableau - tableau[:, column, None] * scaled[None]
    return others.at[row].set(scaled)
