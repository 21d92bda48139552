"""Determine which state components are coordinates and which are velocities."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...hybrid import HybridSystem
from ...hybrid.programs import program


# Number of random points near a recorded state at which the field is evaluated
_LOOKS = 3


def coordinates(
    system: HybridSystem, state: Float[np.ndarray, " n"]
) -> tuple[tuple[int, int], ...]:
    """Return, for each coordinate of a system, the state components that contain the
    coordinate and its velocity.

    A component is a coordinate if its rate of change is another component, possibly
    plus a function of time (as for relative positions with absolute velocities).

    **Arguments:** the system; a state `(n,)` near which its vector field is defined.

    **Raises:** `ValueError` if there is no coordinate.
    """
    state = np.asarray(state, dtype=float)
    size = np.maximum(np.abs(state), 1e-3)
    random = np.random.default_rng(0)
    shifts = random.standard_normal((_LOOKS, len(state)))
    seen = np.asarray(_slopes(system, state + 0.01 * size * shifts))
    found = []
    for place in range(len(state)):
        rows = seen[:, place]
        (moved,) = np.nonzero(np.any(rows != 0, axis=0))
        if len(moved) == 1 and moved[0] != place and np.all(rows[:, moved[0]] == 1):
            found.append((place, int(moved[0])))
    if not found:
        raise ValueError(
            f"{type(system).__name__} has no coordinate: no component of its state is "
            "the rate of change of another one. The state must contain positions and "
            "velocities."
        )
    return tuple(found)


@program
def _slopes(system: HybridSystem, states) -> Float[Array, "k n n"]:
    """Return the Jacobians of the vector field at some states."""
    slope = jax.jacfwd(lambda x: system.vector_field(jnp.asarray(0.0), x))
    return jax.vmap(slope)(states)
