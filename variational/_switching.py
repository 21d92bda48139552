"""Propagate perturbations through the crossing of a switching surface."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import SwitchedSystem
from jaxcam.hybrid.surface import OnSides, resets, surfaces

from ._event_law import event_crossing


def switching_saltation(
    system: SwitchedSystem,
    t,
    state: Float[Array, " n"],
    sides: Float[Array, " k"],
    surface: int = 0,
) -> Float[Array, "n n"]:
    """Return the saltation matrix of the crossing of a switching surface.

    With F- and F+ the branches of the vector field before and after, h the switching
    function, and R the reset (the identity unless the system has one),

        S = R_x + (F+ - R_t - R_x F-) h_x / (h_t + h_x F-),

    explicit time included. Where the field is continuous, as in a bilinear oscillator,
    S is the identity. (R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of
    Non-Smooth Mechanical Systems, 2004, chapter 7)

    Args:
        system: The system.
        t: Time of the crossing (s).
        state: State at the crossing, shape `(n,)`.
        sides: Sides of all surfaces before the crossing, +1 or -1, shape `(k,)`.
        surface: Index of the surface that is crossed.

    Returns:
        Shape `(n, n)`.

    Examples:
        >>> from jaxcam.models import BilinearOscillator
        >>> from variational import switching_saltation
        >>> state, sides = jnp.array([0.0, 1.0]), jnp.array([-1.0])
        >>> switching_saltation(BilinearOscillator(), 0.0, state, sides).tolist()
        [[1.0, 0.0], [0.0, 1.0]]
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    x = jnp.asarray(state, dtype=jnp.float64)
    negative = jnp.asarray(sides) < 0
    crossed = jnp.arange(negative.shape[0]) == surface
    before, after = (OnSides(system, flags) for flags in (negative, negative ^ crossed))
    law_x, moved, normal, speed = event_crossing(
        lambda s, y: resets(before, s, y)[surface],
        lambda s, y: surfaces(system, s, y)[surface],
        before.vector_field,
        after.vector_field,
        t,
        x,
    )
    return law_x + jnp.outer(moved, normal) / speed
