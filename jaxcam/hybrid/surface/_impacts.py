"""Impacts at the constraints, with Coulomb friction."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._contact_friction import friction_of, has_friction, sides_of, surfaces_of
from ._normal import normal_directions, normal_velocity


def impacts(system: HybridSystem, t: RealScalar, x: State) -> Float[Array, "m n"]:
    """Return the state after an impact at each constraint, one row for each; friction
    included.

    Args:
        system: The system.
        t: Time (s).
        x: State just before the impact, shape `(n,)`.

    Returns:
        States after the impact, shape `(m, n)`.

    Examples:
        >>> from jaxcam.hybrid.surface import impacts
        >>> from jaxcam.models import BouncingBall
        >>> impacts(BouncingBall(), 0.0, jnp.array([0.0, -1.0])).tolist()
        [[0.0, 0.8]]
    """
    after = jnp.atleast_2d(system.impact(t, x))
    if not has_friction(system):
        return after
    return _with_friction(system, t, x, after)


def restitution_coefficients(system, t, x) -> Float[Array, " m"]:
    """Return the coefficient of restitution of each constraint in the limit of slow
    impacts.

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.

    Returns:
        Coefficients of restitution, shape `(m,)`.

    Examples:
        >>> from jaxcam.hybrid.surface import restitution_coefficients
        >>> from jaxcam.models import BouncingBall
        >>> r = restitution_coefficients(BouncingBall(), 0.0, jnp.zeros(2))
        >>> round(float(r[0]), 6)
        0.8
    """
    directions = normal_directions(system, t, x)

    def rebound(speed, k):
        after = impacts(system, t, x + speed * directions[k])[k]
        return normal_velocity(system, t, after)[k]

    zero = jnp.zeros_like(t)
    return jnp.stack(
        [
            -jax.jvp(lambda s, k=k: rebound(s, k), (zero,), (jnp.ones_like(t),))[1]
            for k in range(directions.shape[0])
        ]
    )


def _with_friction(
    system: HybridSystem, t: RealScalar, x: State, after: Float[Array, "m n"]
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
