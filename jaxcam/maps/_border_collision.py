"""A fixed point that meets the border of a piecewise-smooth map."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._piecewise import PiecewiseMap


_STEPS = 40


class BorderCollision(NamedTuple):
    """What happens where a fixed point meets the border."""

    kind: str
    """"persistence": the fixed point goes on, on the other side; "nonsmooth fold": two
    of them meet and vanish."""
    period_two: bool
    """Whether an orbit of period two begins there, visiting both sides."""
    stable_left: bool
    """Stability of the fixed point on either side of the border."""
    stable_right: bool
    parameter: float = float("nan")
    """Parameter and state at the border; NaN where matrices alone were classified."""
    state: float = float("nan")


def classify_border_collision(left, right) -> BorderCollision:
    """Feigin's classification, from the derivatives on both sides.

    A fixed point persists where the numbers of real eigenvalues above 1 have an even
    sum, else it is a nonsmooth fold; an orbit of period two begins where the numbers
    below -1 have an odd sum. (M. di Bernardo et al., Piecewise-smooth Dynamical
    Systems, 2008, section 3.1)

    **Arguments:** derivatives on the two sides: numbers, or matrices `(n, n)`.

    Raises:
        ValueError: Where an eigenvalue is 1 or -1, which is degenerate.
    """
    values = [np.linalg.eigvals(np.atleast_2d(m).astype(float)) for m in (left, right)]
    real = [np.real(v[np.abs(np.imag(v)) < 1e-12]) for v in values]
    if any(np.any(np.abs(np.abs(v) - 1) < 1e-12) for v in real):
        raise ValueError(
            "A multiplier at the border is 1 or -1: this collision is degenerate; move "
            "another parameter."
        )
    above = sum(int(np.sum(v > 1)) for v in real)
    below = sum(int(np.sum(v < -1)) for v in real)
    stable = [bool(np.max(np.abs(v)) < 1) for v in values]
    kind = "persistence" if above % 2 == 0 else "nonsmooth fold"
    return BorderCollision(kind, below % 2 == 1, *stable)


def border_collision(
    system: PiecewiseMap, where: Callable, guess, state=0.0
) -> BorderCollision:
    """Where a fixed point of the left rule meets the border, and what happens there.

    **Arguments:** a continuous map, `where` that picks its parameter, and guesses of
    the parameter and of the fixed point.

    Raises:
        ValueError: Where it is not found, or the map jumps at the border.
    """
    unknown = jnp.array([float(state), float(guess)])
    for _ in range(_STEPS):
        residual, matrix = _residual(system, where, unknown)
        step = jnp.linalg.solve(matrix, residual)
        unknown = unknown - step
        if float(jnp.max(jnp.abs(step))) < 1e-13:
            break
    x, parameter = unknown
    residual, _ = _residual(system, where, unknown)
    if not float(jnp.max(jnp.abs(residual))) < 1e-10:
        raise ValueError(
            "No fixed point of the left rule reaches the border near this guess; give "
            "another `guess`."
        )
    moved = eqx.tree_at(where, system, parameter)
    zero = jnp.zeros(())
    if abs(float(moved.left(zero) - moved.right(zero))) > 1e-9:
        raise ValueError(
            "The map jumps at its border, where Feigin's classification does not "
            "apply; look at its attractors on both sides instead."
        )
    left, right = (jax.grad(rule)(zero) for rule in (moved.left, moved.right))
    found = classify_border_collision(float(left), float(right))
    return found._replace(parameter=float(parameter), state=float(x))


@eqx.filter_jit
def _residual(system, where, unknown):
    def both(values):
        moved = eqx.tree_at(where, system, values[1])
        return jnp.stack([moved.left(values[0]) - values[0], values[0]])

    return both(unknown), jax.jacfwd(both)(unknown)
