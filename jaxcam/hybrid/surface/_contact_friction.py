"""Coulomb friction of constraints, in contact and in impacts."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._switched import SwitchedSystem
from .._system import HybridSystem
from ._switches import OnSides, surfaces


def has_friction(system: HybridSystem) -> bool:
    """Return whether the contacts of a system have friction."""
    switched = system.system if isinstance(system, OnSides) else system
    if not isinstance(switched, SwitchedSystem):
        return False
    return type(switched).contact_friction is not SwitchedSystem.contact_friction


def sides_of(system: HybridSystem, t, x) -> Float[Array, " k"]:
    """Return the sides of the motion, +1 or -1."""
    if isinstance(system, OnSides):
        return system.signs
    assert isinstance(system, SwitchedSystem)
    return system.sides(t, x)


def surfaces_of(system: HybridSystem, t, x) -> Float[Array, " k"]:
    """Return the switching functions of a switched system or of one of its branches."""
    return surfaces(system.system if isinstance(system, OnSides) else system, t, x)


def friction_of(system: HybridSystem, t, x) -> Float[Array, "m n"]:
    """Return the friction of each contact, per unit of its normal force, on the sides
    of the motion.
    """
    switched: Any = system.system if isinstance(system, OnSides) else system
    return jnp.atleast_2d(switched.contact_friction(t, x, sides_of(system, t, x)))


def with_friction(
    system, t, x, after: Float[Array, "m n"], normal_velocity: Callable
) -> Float[Array, "m n"]:
    """Add the impulses of friction to frictionless impacts.

    Each is the friction of a contact times the impulse in the normal direction, but at
    most what stops the slip (Coulomb's law; exact where the normal impulse does not
    change the slip).
    """
    kicks = friction_of(system, t, x)
    before = normal_velocity(system, t, x)

    def slips(y):
        return sides_of(system, t, x) * surfaces_of(system, t, y)

    rows = []
    for k in range(after.shape[0]):
        impulse = normal_velocity(system, t, after[k])[k] - before[k]
        kick = impulse * kicks[k]
        at_first, at_last = slips(after[k]), slips(after[k] + kick)
        # surfaces that this friction does not change are none of its slips
        reverses = (at_last < 0) & (at_last < at_first)
        change = jnp.where(reverses, at_first - at_last, 1.0)
        share = jnp.where(reverses, jnp.maximum(at_first, 0.0) / change, 1.0)
        rows.append(after[k] + jnp.min(share) * kick)
    return jnp.stack(rows)
