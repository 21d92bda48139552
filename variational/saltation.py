"""Propagate perturbations through events: impacts, starts of contact and releases."""

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
    """Return the saltation matrix, which maps a perturbation across an impact.

    With F- and F+ the vector field before and after the impact, R the impact law, H the
    gap, and subscripts for partial derivatives,

        S = R_x + (F+ - R_t - R_x F-) H_x / (H_t + H_x F-),

    which includes the explicit dependence on time, so that moving constraints need no
    extra terms (M. di Bernardo, C. J. Budd, A. R. Champneys, P. Kowalczyk,
    Piecewise-smooth Dynamical Systems, 2008, chapter 2).

    Args:
        system: The system.
        t: Time of the impact (s).
        state_before: State just before the impact, shape `(n,)`, with a negative normal
            velocity.
        constraint: Index of the constraint that is hit.

    Returns:
        The matrix, shape `(n, n)`. Near grazing, it grows like the inverse of the
            impact speed.

    Raises:
        ValueError: The normal velocity is not negative, so there is no impact; inside
            `jit`, the matrix is infinite instead.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational import saltation_matrix
        >>> s = saltation_matrix(BouncingBall(), 0.0, jnp.array([0.0, -1.0]))
        >>> np.asarray(s).round(3).tolist()
        [[-0.8, 0.0], [17.658, -0.8]]
    """
    parts = saltation_parts(system, t, state_before, constraint)
    if not isinstance(parts.speed, Tracer) and not float(parts.speed) < 0:
        raise ValueError(
            f"the normal velocity is {float(parts.speed):g}, so there is no impact; "
            "give the state just before an impact, or use saltation_parts for "
            "grazing: the matrix is regular + singular / speed"
        )
    return parts.matrix


class SaltationParts(eqx.Module):
    """The parts of a saltation matrix S = regular + singular / speed; both remain
    bounded at grazing.
    """

    regular: Float[Array, "n n"]
    """The bounded part, shape `(n, n)`."""
    singular: Float[Array, "n n"]
    """The rank-one part, which is divided by the speed, shape `(n, n)`."""
    speed: Float[Array, ""]
    """Normal velocity before the impact; zero at grazing."""

    @property
    def matrix(self) -> Float[Array, "n n"]:
        """The saltation matrix, shape `(n, n)`."""
        return self.regular + self.singular / self.speed

    @property
    def limit(self) -> Float[Array, "n n"]:
        """The limit of S times the speed at grazing, shape `(n, n)`."""
        return self.singular + self.speed * self.regular


def saltation_parts(
    system: HybridSystem, t, state_before: Float[Array, " n"], constraint: int = 0
) -> SaltationParts:
    """Split a saltation matrix into a bounded part and a part that grows near grazing.

    Args:
        system: The system.
        t: Time of the impact (s).
        state_before: State just before the impact, shape `(n,)`; the normal velocity
            may be zero.
        constraint: Index of the constraint that is hit.

    Returns:
        A [`variational.saltation.SaltationParts`][].

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational import saltation_parts
        >>> parts = saltation_parts(BouncingBall(), 0.0, jnp.array([0.0, 0.0]))
        >>> int(np.linalg.matrix_rank(parts.singular))
        1
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
    """Return the matrix that maps a perturbation before an impact to a perturbation in
    the contact that follows.

    Use this matrix for an impact after which contact begins immediately: a plastic
    impact, or an impact in a chatter sequence whose remaining impacts are completed
    analytically. The normal velocity after the impact is zero, and the field is that of
    contact (thesis, eq. 2.30). The rank falls by two, because gap and normal velocity
    are then zero regardless of their previous values; in a system with two states, all
    perturbations are removed, and the motion has no memory of its past.

    Args:
        system: The system.
        t: Time (s).
        state_before: State just before the impact, shape `(n,)`.
        constraint: Index of the constraint.

    Returns:
        The matrix, shape `(n, n)`.

    Examples:
        >>> from jaxcam.models import TripleIntegrator
        >>> from variational.saltation import saltation_into_contact
        >>> before = jnp.array([0.0, -1.0, -2.0])
        >>> matrix = saltation_into_contact(TripleIntegrator(), 0.0, before)
        >>> int(np.linalg.matrix_rank(matrix))
        1
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
    """Return the matrix that maps a perturbation in contact to a perturbation in the
    flight after release.

    At release, the contact field and the free field are equal, so the perturbation is
    unchanged. The matrix is the identity for perturbations allowed by contact, and zero
    in the directions that contact has removed.

    Args:
        system: The system.
        t: Time (s).
        state: State at release, shape `(n,)`.
        constraint: Index of the constraint.

    Returns:
        The matrix, shape `(n, n)`.

    Examples:
        >>> from jaxcam.models import TripleIntegrator
        >>> from variational.saltation import saltation_at_release
        >>> saltation_at_release(TripleIntegrator(), 0.0, jnp.zeros(3)).tolist()
        [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    x = jnp.asarray(state, dtype=jnp.float64)
    number = gaps(system, t, x).shape[0]
    return contact_projector(system, t, x, jnp.arange(number) == constraint)


def event_map(
    system: HybridSystem, t, x: Float[Array, " n"], constraint: int = 0
) -> Float[Array, " n"]:
    """Return the state after an impact for a state near it, both at the same time t.

    The motion is continued from `x` to its impact, before or after `t`; the impact law
    is applied; and the motion is followed back to `t` (the discontinuity mapping of di
    Bernardo et al., Piecewise-smooth Dynamical Systems, 2008, chapter 2). Flights are
    third-order Taylor series, and the impact is located by three Newton steps, so
    values and derivatives up to third order are exact at a state on the surface.

    Args:
        system: The system.
        t: Time (s).
        x: State near the surface, shape `(n,)`.
        constraint: Index of the constraint that is hit.

    Returns:
        State after the impact, shape `(n,)`.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational import event_map
        >>> event_map(BouncingBall(), 0.0, jnp.array([0.0, -1.0])).tolist()
        [0.0, 0.8]
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
    """Return the second derivative of the flow across an impact, for normal forms.

    A perturbation d becomes S d + (1/2) d B d + O(|d|^3), where S is the saltation
    matrix, and `B[i, j, k]` is returned. It is computed by nested forward
    differentiation of [`variational.event_map`][], and grows like the inverse cube of
    the impact speed.

    Args:
        system: The system.
        t: Time (s).
        state_before: State just before the impact, shape `(n,)`.
        constraint: Index of the constraint.

    Returns:
        The derivative B, shape `(n, n, n)`.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational.saltation import saltation_second
        >>> second = saltation_second(BouncingBall(), 0.0, jnp.array([0.0, -1.0]))
        >>> np.asarray(second[:, 0, 0]).round(3).tolist()
        [-17.658, -173.225]
        >>> [round(-1.8 * 9.81, 3), round(-1.8 * 9.81**2, 3)]  # -(1 + r) g^k for v = 1
        [-17.658, -173.225]
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    x = jnp.asarray(state_before, dtype=jnp.float64)
    return jax.jacfwd(jax.jacfwd(lambda y: event_map(system, t, y, constraint)))(x)


def _taylor(system, t, x, tau):
    """Return the flow over a short time `tau`, to third order."""

    def along(function):
        def rate(s, y):
            field = system.vector_field(s, y)
            return jax.jvp(function, (s, y), (jnp.ones_like(s), field))[1]

        return rate

    first = system.vector_field
    second = along(first)
    third = along(second)
    return x + tau * (first(t, x) + tau * (second(t, x) / 2 + tau * third(t, x) / 6))
