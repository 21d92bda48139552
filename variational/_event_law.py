"""Propagate a perturbation through an event: an impact, a start of contact, or a
release.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.surface import (
    field_in_force,
    gaps,
    impacts,
    normal_directions,
    normal_velocity,
)


def gap_of(system: HybridSystem, constraint) -> Callable:
    """Return the gap of one constraint as a function of (t, x)."""
    return lambda t, x: gaps(system, t, x)[constraint]


def impact_of(system: HybridSystem, constraint) -> Callable:
    """Return the impact law of one constraint as a function of (t, x)."""
    return lambda t, x: impacts(system, t, x)[constraint]


def completed_law(system: HybridSystem, constraint) -> Callable:
    """Return the combined law of an impact and all later impacts of its chatter
    sequence.

    The state after the sequence is the linear combination of the states before and
    after the impact that has zero normal velocity; to second order in the speed, the
    duration of the rest of the sequence is negligible.
    """
    impact = impact_of(system, constraint)

    def law(t, x):
        after = impact(t, x)
        v_before = normal_velocity(system, t, x)[constraint]
        v_after = normal_velocity(system, t, after)[constraint]
        return x - v_before / (v_after - v_before) * (after - x)

    return law


def field_of(system: HybridSystem, contact: Bool[Array, " m"] | None) -> Callable:
    """Return the vector field of free flight, or of contact with the constraints marked
    in `contact`.
    """
    if contact is None:
        return system.vector_field
    return lambda t, x: field_in_force(system, t, x, contact)


def event_crossing(
    law: Callable, gap: Callable, field_before: Callable, field_after: Callable, t, x
) -> tuple[Float[Array, "n n"], Float[Array, " n"], Float[Array, " n"], Array]:
    """Return R_x, w = F+ - R_t - R_x F-, the normal H_x, and the rate of change v of
    the gap.

    Here, R is the `law`, H the `gap`, and F- and F+ are the fields before and after the
    event. The derivative of the flow across the event is R_x + w H_x / v.
    """
    flow_before = field_before(t, x)
    after, law_rate = jax.jvp(lambda s: law(s, x), (t,), (jnp.ones_like(t),))
    law_x = jax.jacfwd(law, argnums=1)(t, x)
    rate, normal = jax.grad(gap, argnums=(0, 1))(t, x)
    speed = rate + normal @ flow_before
    return law_x, field_after(t, after) - law_rate - law_x @ flow_before, normal, speed


def onto_contact(
    system: HybridSystem, t, x, contact: Bool[Array, " m"]
) -> Float[Array, " n"]:
    """Return the state after one Newton step towards gap = normal velocity = 0 for the
    constraints in contact.

    A state in contact is not changed, but the derivative of the step projects
    perturbations onto those allowed by contact. The rank of this derivative falls by
    two for each constraint, while the dependence of the contact state on the parameters
    remains.
    """
    values = gaps(system, t, x)
    normals = jax.jacfwd(lambda y: gaps(system, t, y))(x)
    for k in range(values.shape[0]):
        lift = normals[k] / jnp.sum(normals[k] * normals[k])
        lifted = x - gaps(system, t, x)[k] * lift
        slip = normal_velocity(system, t, lifted)[k]
        settled = lifted - slip * normal_directions(system, t, x)[k]
        x = jnp.where(contact[k], settled, x)
    return x


def contact_projector(
    system: HybridSystem, t, x, contact: Bool[Array, " m"]
) -> Float[Array, "n n"]:
    """Return the derivative of `onto_contact`; for a system of two states in contact,
    the derivative is exactly zero.
    """
    out = jax.jacfwd(lambda y: onto_contact(system, t, y, contact))(x)
    if x.shape[0] == 2:
        # exactly zero, because a rounding error divided by a small impact speed would
        # be large
        out = jnp.where(jnp.any(contact), jnp.zeros_like(out), out)
    return out
