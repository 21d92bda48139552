"""The derivative of the flow across an event, and its own derivative."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.surface import gaps

from ._event_law import (
    completed_law,
    contact_projector,
    event_crossing,
    field_of,
    gap_of,
    impact_of,
)


def saltation_matrix(
    system: HybridSystem, t, state_before: Float[Array, " n"], constraint: int = 0
) -> Float[Array, "n n"]:
    """How a deviation just before an impact becomes one just after it.

    With F-, F+ the vector field before and after, R the impact law and H the gap,

        S = R_x + (F+ - R_t - R_x F-) H_x / (H_t + H_x F-),

    explicit time included, so that moving constraints need nothing extra.

    **Arguments:** the time of the impact (s), the state just before it, shape `(n,)`,
    with a normal velocity below zero, and which constraint is hit.

    Returns:
        Shape `(n, n)`. Grows like one over the impact speed near grazing.

    Raises:
        ValueError: Where the speed is not below zero, so that no impact happens; inside
            `jit` the matrix is infinite there.
    """
    parts = saltation_parts(system, t, state_before, constraint)
    if not isinstance(parts.speed, Tracer) and not float(parts.speed) < 0:
        raise ValueError(
            f"the normal velocity is {float(parts.speed):g}, which is no impact; "
            "give the state just before it, and for a graze use "
            "saltation_parts: the matrix is regular + singular / speed"
        )
    return parts.matrix


class SaltationParts(eqx.Module):
    """S = regular + singular / speed; both parts stay bounded at a graze."""

    regular: Float[Array, "n n"]
    singular: Float[Array, "n n"]
    """Of rank one."""
    speed: Float[Array, ""]
    """Normal velocity before the impact, zero at a graze."""

    @property
    def matrix(self) -> Float[Array, "n n"]:
        """The saltation matrix."""
        return self.regular + self.singular / self.speed

    @property
    def limit(self) -> Float[Array, "n n"]:
        """What S times the speed tends to at the graze."""
        return self.singular + self.speed * self.regular


def saltation_parts(
    system: HybridSystem, t, state_before: Float[Array, " n"], constraint: int = 0
) -> SaltationParts:
    """The bounded part of a saltation matrix, and the one that grows near grazing.

    **Arguments:** as for [`variational.saltation_matrix`][]; the speed may be zero.
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    x = jnp.asarray(state_before, dtype=jnp.float64)
    field = system.vector_field
    law, gap = impact_of(system, constraint), gap_of(system, constraint)
    regular, moved, normal, speed = event_crossing(law, gap, field, field, t, x)
    return SaltationParts(regular, jnp.outer(moved, normal), speed)


def saltation_into_contact(
    system: HybridSystem, t, state_before: Float[Array, " n"], constraint: int = 0
) -> Float[Array, "n n"]:
    """How a deviation before an impact becomes one of the contact that follows it.

    For the impact from which contact begins at once: a plastic one, or one deep in a
    chatter, whose remaining impacts are summed. The law is the one that leaves no
    normal velocity, the field after it that of contact (2.30). The rank falls by two,
    because gap and normal velocity are zero from then on whatever they were: with two
    states nothing is left, and a motion that sticks has forgotten its past.

    Returns:
        Shape `(n, n)`.
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    x = jnp.asarray(state_before, dtype=jnp.float64)
    number = gaps(system, t, x).shape[0]
    contact = jnp.arange(number) == constraint
    law_x, moved, normal, speed = event_crossing(
        completed_law(system, constraint),
        gap_of(system, constraint),
        system.vector_field,
        field_of(system, contact),
        t,
        x,
    )
    rest = completed_law(system, constraint)(t, x)
    projector = contact_projector(system, t, rest, contact)
    return projector @ (law_x + jnp.outer(moved, normal) / speed)


def saltation_at_release(
    system: HybridSystem, t, state: Float[Array, " n"], constraint: int = 0
) -> Float[Array, "n n"]:
    """How a deviation in contact becomes one of the flight after release.

    At release the constraint has ceased to press: contact field and free field are
    equal, and the deviation goes on as it is. The matrix is the identity on the motions
    in contact, and zero on what contact has taken.

    Returns:
        Shape `(n, n)`.
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    x = jnp.asarray(state, dtype=jnp.float64)
    number = gaps(system, t, x).shape[0]
    return contact_projector(system, t, x, jnp.arange(number) == constraint)


def event_map(
    system: HybridSystem, t, x: Float[Array, " n"], constraint: int = 0
) -> Float[Array, " n"]:
    """Where a motion close to an impact is after it, both at the same time t.

    The motion is continued from `x` to its impact, sooner or later than `t`, the law is
    applied, and it is followed back to `t` (the discontinuity mapping of di Bernardo
    et al., Piecewise-smooth Dynamical Systems, 2008, chapter 2). Flights are Taylor
    series of third order, and the impact is found by three steps of Newton's method, so
    that values and derivatives up to the third are exact at a state on the surface.
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    law, gap = impact_of(system, constraint), gap_of(system, constraint)

    def flown(tau, s, y):
        return _taylor(system, s, y, tau)

    def height(tau):
        return gap(t + tau, flown(tau, t, x))

    tau = jnp.zeros_like(t)
    for _ in range(3):
        value, slope = jax.jvp(height, (tau,), (jnp.ones_like(tau),))
        tau = tau - value / slope
    return flown(-tau, t + tau, law(t + tau, flown(tau, t, x)))


def saltation_second(
    system: HybridSystem, t, state_before: Float[Array, " n"], constraint: int = 0
) -> Float[Array, "n n n"]:
    """Second derivative of the flow across an impact, for normal forms.

    The change of a deviation d is S d + (1/2) d B d + O(|d|^3), where
    `B[i, j, k]` is what is returned. By nested forward differentiation of
    [`variational.event_map`][]. Grows like one over the cube of the impact speed.
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    x = jnp.asarray(state_before, dtype=jnp.float64)
    return jax.jacfwd(jax.jacfwd(lambda y: event_map(system, t, y, constraint)))(x)


def _taylor(system, t, x, tau):
    """The flow over a short time `tau`, to third order."""

    def along(function):
        def rate(s, y):
            field = system.vector_field(s, y)
            return jax.jvp(function, (s, y), (jnp.ones_like(s), field))[1]

        return rate

    first = system.vector_field
    second = along(first)
    third = along(second)
    return x + tau * (first(t, x) + tau * (second(t, x) / 2 + tau * third(t, x) / 6))
