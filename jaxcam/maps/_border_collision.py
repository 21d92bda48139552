"""Collisions of a fixed point with the border of a piecewise-smooth map."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..hybrid.programs import program
from ._piecewise import PiecewiseMap


_STEPS = 40


class BorderCollision(NamedTuple):
    """The scenario at a border collision of a fixed point."""

    kind: str
    """"persistence": the fixed point continues on the other side; "nonsmooth fold": two
    fixed points meet and disappear.
    """
    period_two: bool
    """Whether an orbit of period two emerges, visiting both sides."""
    stable_left: bool
    """Whether the fixed point is stable left of the border."""
    stable_right: bool
    """Whether the fixed point is stable right of the border."""
    parameter: float = float("nan")
    """Parameter at the collision; NaN if only matrices were classified."""
    state: float = float("nan")
    """State at the collision; NaN if only matrices were classified."""


def classify_border_collision(left, right) -> BorderCollision:
    """Classify a border collision by the derivatives on both sides (Feigin).

    A fixed point persists if the total number of real eigenvalues above 1 on both sides
    is even; otherwise, the collision is a nonsmooth fold. An orbit of period two
    emerges if the total number of those below -1 is odd. (M. di Bernardo et al.,
    Piecewise-smooth Dynamical Systems, 2008, section 3.1)

    Args:
        left: Derivative on the left: a number, or a matrix `(n, n)`.
        right: Derivative on the right.

    Returns:
        A `BorderCollision`.

    Raises:
        ValueError: An eigenvalue is 1 or -1, which is degenerate.

    Examples:
        >>> from jaxcam.maps import classify_border_collision
        >>> classify_border_collision(0.5, -2.0).period_two
        True
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
    """Locate and classify the border collision of a fixed point with x <= 0.

    Args:
        system: A continuous map.
        where: Selects the parameter.
        guess: Initial guess for the parameter.
        state: Initial guess for the fixed point.

    Returns:
        A `BorderCollision`.

    Raises:
        ValueError: No collision is found, or the map jumps at the border.

    Examples:
        >>> from jaxcam.maps import SkewMap, border_collision
        >>> border_collision(SkewMap(a=0.5, b=-2.0, mu=0.1), lambda m: m.mu, 0.1).kind
        'persistence'
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
            "No fixed point with x <= 0 reaches the border near this guess; give "
            "another `guess`."
        )
    moved = eqx.tree_at(where, system, parameter)
    zero = jnp.zeros(())
    if abs(float(moved.left(zero) - moved.right(zero))) > 1e-9:
        raise ValueError(
            "The map jumps at its border, where Feigin's classification does not "
            "apply; compute its attractors on both sides instead."
        )
    left, right = (jax.grad(rule)(zero) for rule in (moved.left, moved.right))
    found = classify_border_collision(float(left), float(right))
    return found._replace(parameter=float(parameter), state=float(x))


@program
def _residual(system, where, unknown):
    def both(values):
        moved = eqx.tree_at(where, system, values[1])
        return jnp.stack([moved.left(values[0]) - values[0], values[0]])

    return both(unknown), jax.jacfwd(both)(unknown)
