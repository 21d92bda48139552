"""Forces of the constraints in contact, with Coulomb friction.

The notation is that of `_normal.py`: the field in contact is F - sum q_k D_k, with the
multipliers q and the directions D, which include friction.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._contact_friction import friction_of, has_friction
from ._least_multipliers import least_multipliers
from ._masked import FEW, solve_masked
from ._normal import gaps, normal_velocity, unit_directions


class ContactTerms(NamedTuple):
    """Terms on which the contact forces depend, apart from the field and friction.

    They are the same on all sides of the switching surfaces.
    """

    # rates of the normal velocities with time and with the state
    drift: Float[Array, " m"]
    gradient: Float[Array, "m n"]
    # unit directions of the impulses without friction
    directions: Float[Array, "m n"]


class ContactForces(NamedTuple):
    """The multipliers q, and the field with the contact forces."""

    multipliers: Float[Array, " m"]
    field: State


def multipliers_at_ends(
    system: HybridSystem,
    t: RealScalar,
    x: State,
    contact: Bool[Array, " m"],
    multipliers: Float[Array, " m"],
    terms: ContactTerms | None = None,
) -> Float[Array, " m"]:
    """Return multipliers that rise through zero when a contact ends, also if supports
    are redundant: see `least_multipliers`.
    """
    if len(multipliers) < FEW:
        return multipliers
    terms = contact_terms(system, t, x) if terms is None else terms
    return least_multipliers(
        terms.gradient @ _pushes(system, t, x, terms).T, multipliers, contact
    )


def _pushes(system, t, x, terms: ContactTerms) -> Float[Array, "m n"]:
    """Return the directions of the contact forces, with friction."""
    if not has_friction(system):
        return terms.directions
    return terms.directions + friction_of(system, t, x)


def contact_terms(system: HybridSystem, t: RealScalar, x: State) -> ContactTerms:
    """Return the terms that determine the contact forces at a state."""
    one = jnp.ones_like(t)
    _, drift = jax.jvp(lambda s: normal_velocity(system, s, x), (t,), (one,))
    gradient = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    return ContactTerms(drift, gradient, unit_directions(system, t, x, gradient))


def contact_forces(
    system: HybridSystem,
    t: RealScalar,
    x: State,
    contact: Bool[Array, " m"],
    terms: ContactTerms | None = None,
) -> ContactForces:
    """Return the multipliers and the field; `terms` are computed unless given."""
    terms = contact_terms(system, t, x) if terms is None else terms
    drift, gradient, _ = terms
    free, pushes = system.vector_field(t, x), _pushes(system, t, x, terms)
    acceleration = drift + gradient @ free
    # a gap may have no gradient, and its constraint no direction, away from contact
    acting = jnp.where(contact[:, None], pushes, 0.0)
    if len(pushes) == 1 and not has_friction(system):
        found = jnp.where(contact, acceleration, jnp.zeros_like(acceleration))
        return ContactForces(found, free - found[0] * acting[0])
    found = solve_masked(gradient @ pushes.T, acceleration, contact)
    return ContactForces(found, free - jnp.sum(found[:, None] * acting, axis=0))


def contact_multipliers(system, t, x, contact: Bool[Array, " m"]) -> Float[Array, " m"]:
    """Return q with F_s = F - sum q_k D_k over the constraints in contact, where the
    D_k include friction.

    With one constraint without friction, q = a. The contact force is compressive while
    q < 0, and the contact ends when q rises through zero. For constraints that are not
    in contact, q is zero. If a support is redundant, q is that of
    `least_multipliers`.
    """
    terms = contact_terms(system, t, x)
    found = contact_forces(system, t, x, contact, terms).multipliers
    return multipliers_at_ends(system, t, x, contact, found, terms)


def field_in_force(system, t, x, contact: Bool[Array, " m"]) -> State:
    """Return the field of free flight, or of sticking on the constraints in `contact`.

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.
        contact: Whether each constraint is in contact, shape `(m,)`.

    Returns:
        Rates of the state, shape `(n,)` (thesis, eq. 2.30).

    Examples:
        >>> from jaxcam.hybrid.surface import field_in_force
        >>> from jaxcam.models import BouncingBall
        >>> ball, held = BouncingBall(), jnp.array([True])
        >>> field_in_force(ball, 0.0, jnp.zeros(2), held).tolist()
        [0.0, 0.0]
    """
    if not contact.shape[0]:
        return system.vector_field(t, x)
    return contact_forces(system, t, x, contact).field


def sticking_field(system: HybridSystem, t: RealScalar, x: State) -> State:
    """Return the field of sustained contact with every constraint.

    Args:
        system: The system.
        t: Time (s).
        x: State on the surface, shape `(n,)`.

    Returns:
        Rates of the state, shape `(n,)` (thesis, eqs. 2.30 and 2.31).

    Examples:
        >>> from jaxcam.hybrid.surface import sticking_field
        >>> from jaxcam.models import BouncingBall
        >>> sticking_field(BouncingBall(), 0.0, jnp.zeros(2)).tolist()
        [0.0, 0.0]
    """
    everywhere = jnp.ones(gaps(system, t, x).shape, dtype=bool)
    return field_in_force(system, t, x, everywhere)


class Distances(NamedTuple):
    """The functions whose time derivatives a step needs, in one mode."""

    gaps: Float[Array, " m"]
    # multipliers of the contacts
    multipliers: Float[Array, " m"]
    # distances from the switching surfaces, zero at a crossing or at the end of sliding
    surfaces: Float[Array, " k"]
    # whether a contact holds the motion at rest at the surface
    still: Bool[Array, " k"]


def field_and_distances(
    system, t, x, contact: Bool[Array, " m"]
) -> tuple[State, Distances]:
    """Return the field and the distances of a system without switching surfaces."""
    terms = contact_terms(system, t, x)
    found, field = contact_forces(system, t, x, contact, terms)
    found = multipliers_at_ends(system, t, x, contact, found, terms)
    none = jnp.zeros((0,))
    return field, Distances(gaps(system, t, x), found, none, none.astype(bool))
