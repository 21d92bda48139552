"""Coulomb friction of the constraints in contact."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._switched import SwitchedSystem
from .._system import HybridSystem
from ._switches import OnSides, surfaces


def has_friction(system: HybridSystem) -> bool:
    """Return whether the contacts of a system have friction."""
    switched = _whole(system)
    return isinstance(switched, SwitchedSystem) and switched.has_contact_friction


def sides_of(system: HybridSystem, t, x) -> Float[Array, " k"]:
    """Return the sides of the surfaces on which the motion is, +1 or -1."""
    if isinstance(system, OnSides):
        return system.signs
    assert isinstance(system, SwitchedSystem)
    return system.sides(t, x)


def surfaces_of(system: HybridSystem, t, x) -> Float[Array, " k"]:
    """Return the switching functions of a switched system or of one of its branches."""
    return surfaces(_whole(system), t, x)


def friction_of(system: HybridSystem, t, x) -> Float[Array, "m n"]:
    """Return the friction of each contact, per unit of its normal force, on the sides
    of the motion.
    """
    return friction_on(system, t, x, sides_of(system, t, x))


def friction_on(
    system: HybridSystem, t, x, sides: Float[Array, " k"]
) -> Float[Array, "m n"]:
    """Return the friction of each contact on the given sides."""
    return jnp.atleast_2d(_whole(system).contact_friction(t, x, sides))


def restitution_kind(system: HybridSystem) -> str:
    """Return the restitution hypothesis of a system with friction."""
    return _whole(system).restitution_kind


def _whole(system: HybridSystem) -> Any:
    """Return the system, or the switched system of which it is a branch (`OnSides`)."""
    return system.system if isinstance(system, OnSides) else system
