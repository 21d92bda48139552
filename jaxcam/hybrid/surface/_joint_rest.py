"""Bodies that come to rest on several constraints at the same time."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._contact_forces import contact_multipliers
from ._masked import solve_masked
from ._normal import (
    gaps,
    normal_directions,
    normal_velocity,
)


# Flights shorter than this fraction of the longest allowed step are negligible
SHORT_FLIGHT = 1e-8
# Normal velocities below this fraction of the fastest rebound are negligible
SLOW_REBOUND = 1e-13
# An impact loses energy if the ratio of rebound to approach velocity is below this
LOSSY_RATIO = 1 - 1e-9


def joint_rest(
    system: HybridSystem, t: RealScalar, x: State, touching: Bool[Array, " m"]
) -> tuple[State, Float[Array, " m"]]:
    """Return the state at rest on the `touching` constraints, and their multipliers.

    Gaps and normal velocities are removed by one Newton step each: gaps along their
    gradients, velocities along the impulses.

    Args:
        system: The system.
        t: Time (s).
        x: State close to rest on these constraints, shape `(n,)`.
        touching: Whether the bodies rest on each constraint, shape `(m,)`.

    Returns:
        The state, shape `(n,)`, and the multipliers q of
            [`field_in_force`][jaxcam.hybrid.surface.field_in_force], shape `(m,)`;
            a contact is compressive if q < 0.

    Examples:
        >>> from jaxcam.hybrid.surface import joint_rest
        >>> from jaxcam.models import BouncingBall
        >>> state, q = joint_rest(
        ...     BouncingBall(), 0.0, jnp.array([1e-9, 1e-5]), jnp.array([True])
        ... )
        >>> state.tolist(), q.tolist()
        ([0.0, 0.0], [-9.81])
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    gradient = jax.jacfwd(lambda y: gaps(system, t, y))(x)
    slope = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    lift = gradient / jnp.sum(gradient * gradient, axis=1)[:, None]
    push = normal_directions(system, t, x)
    coupling = slope @ push.T
    heights = solve_masked(gradient @ lift.T, gaps(system, t, x), touching)
    lowered = heights @ lift
    speeds = normal_velocity(system, t, x) - slope @ lowered
    stopped = solve_masked(coupling, speeds, touching) @ push
    return x - lowered - stopped, contact_multipliers(system, t, x, touching)
