"""Determine whether a surface of a system moves."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ...hybrid import HybridSystem
from ...hybrid.lowering import used_inputs


def moves_surface(system: HybridSystem, state: Float[np.ndarray, " n"]) -> bool:
    """Return whether a gap depends explicitly on time, as it does above a cam.

    In a system with a forcing, such as a force that acts on the moving mass, the
    surfaces may be at rest; there is then no profile that could be wrong.

    **Arguments:** the system; a state `(n,)`, of which only the shape matters.
    """
    closed = jax.make_jaxpr(system.gap)(jnp.zeros(()), jnp.asarray(state, float))
    return used_inputs(closed)[0]
