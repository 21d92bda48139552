"""Contacts of bodies that start at rest on several constraints."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._complementary import complementary
from ._normal import normal_acceleration, normal_directions, normal_velocity


# A force or acceleration below this fraction of the largest one is a rounding error
_ROUNDING = 1e-12


def pressed_accelerations(
    system: HybridSystem, t: RealScalar, x: State, touching: Bool[Array, " m"]
) -> Float[Array, " m"]:
    """Return the normal accelerations under the contact forces that prevent
    penetration, without friction; for a constraint that presses, return minus the
    acceleration that its force prevents, and a small negative number if other
    constraints hold the body there.

    A constraint that would open in free flight may press because others do, and the
    other way round: accelerations a and contact forces p are complementary (F.
    Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts, 1996, section 5).

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.
        touching: Which gaps and normal velocities are zero, shape `(m,)`.

    Returns:
        Accelerations, shape `(m,)`; negative where the constraint presses.
    """
    slope = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    matrix = slope @ normal_directions(system, t, x).T
    free = normal_acceleration(system, t, x)
    forces = complementary(matrix, free, touching)
    after = free + matrix @ forces
    size = _ROUNDING * jnp.max(jnp.abs(free) + jnp.abs(forces))
    held = jnp.any(forces > size) & (jnp.abs(after) <= size)
    after = jnp.where(held, -size, after)
    return jnp.where(forces > size, -forces, after)
