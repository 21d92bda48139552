"""Complete a chatter sequence by a formula for its remaining duration.

After an impact with small rebound speed u the normal motion is y'' = A + B t + C y',
where A < 0 is the normal acceleration of the state without normal velocity, B its rate
of change along the sticking motion, and C the derivative of the normal acceleration
with respect to the normal velocity. With restitution r0 + r1 v, the infinitely many
remaining flights last

    T = 2 u (1 + r1 u / (1 - r0^2)) / (|A| (1 - r0))
        - (4/3) B u^2 / (A^3 (1 - r0)^2) + (2/3) C u^2 / (A^2 (1 - r0)^2) + O(u^3).

For C = r1 = 0, this is the expansion behind eq. (3.17) of the thesis, carried to second
order; the small parameter is lambda / (1 - r0), with lambda = u |j| / A^2 and j the
jerk. The rest of the state follows the sticking field from the state P, from which the
normal velocity has been removed in the direction of the impulse; this is accurate to
the same order.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._contact_forces import sticking_field
from ._impacts import impacts, restitution_coefficients
from ._normal import (
    lie_derivative,
    normal_acceleration,
    normal_directions,
    normal_velocity,
)


def completion_time(
    speed, acceleration, rate, damping, restitution, softening: ArrayLike = 0.0
):
    """Return the duration of the remaining impacts of a chatter sequence, to second
    order in `speed`.

    Args:
        speed: Rebound speed u > 0.
        acceleration: Normal acceleration A < 0.
        rate: Rate of change B of A along the sticking motion.
        damping: Derivative C of the normal acceleration with respect to normal
            velocity.
        restitution: Coefficient of restitution r0 in the limit of slow impacts.
        softening: Slope r1 of the coefficient of restitution, r0 + r1 v, where v is the
            approach speed.

    Returns:
        Duration T, in the units of u/A (thesis, eq. 3.17, carried to second order).

    Examples:
        >>> from jaxcam.hybrid.surface import completion_time
        >>> float(completion_time(1.0, -10.0, 0.0, 0.0, 0.5))
        0.4
    """
    rest = 1 - restitution
    inverse = 1 / acceleration
    small = speed * inverse / rest
    series = 1 + softening * speed / (1 - restitution * restitution)
    return -2 * small * series + small * small * (
        (2 / 3) * (damping - 2 * rate * inverse)
    )


def completion_coefficients(system, t, before, after, approach, rebound):
    """Return C and r0 of each constraint, for an impact from `before` to `after`, and
    from the normal velocities `approach` to `rebound`, each `(m,)`.

    The third result is the state P without normal velocity, one row for each
    constraint, as if that constraint had been hit.
    """
    jump = rebound - approach
    safe = jnp.where(jump > 0, jump, jnp.ones_like(jump))
    inverse = 1 / safe
    share = -approach * inverse
    damping, restitution, rest = [], [], []
    for k in range(jump.shape[0]):
        direction = (after - before) * inverse[k]
        point = before + share[k] * (after - before)
        damping.append(
            jax.jvp(
                lambda y, k=k: normal_acceleration(system, t, y)[k],
                (point,),
                (direction,),
            )[1]
        )
        restitution.append(
            -jax.jvp(
                lambda y, k=k: normal_velocity(system, t, impacts(system, t, y)[k])[k],
                (point,),
                (direction,),
            )[1]
        )
        rest.append(point)
    return jnp.stack(damping), jnp.stack(restitution), jnp.stack(rest)


class Completion(NamedTuple):
    """The end of a chatter sequence."""

    time: Float[Array, ""]
    """Accumulation time (s)."""
    state: Float[Array, " n"]
    """State at the accumulation time, shape `(n,)`."""
    smallness: Float[Array, ""]
    """The parameter lambda/(1 - r), which must be small for the completion to be valid:
    lambda = u |j| / a^2, with rebound speed u, jerk j, normal acceleration a (for zero
    normal velocity), and coefficient of restitution r.
    """


def chatter_completion(
    system: HybridSystem, t: RealScalar, state: State, order: int = 2
) -> Completion:
    """Complete the chatter that starts on the surface, just after an impact.

    Args:
        system: A system with one constraint.
        t: Time of the impact (s).
        state: State just after the impact, shape `(n,)`: gap zero, normal velocity u >
            0, acceleration a < 0.
        order: 1 for the thesis, eq. (3.17), with error O(u^2); 2 for the second-order
            map, error O(u^3).

    Returns:
        The accumulation time (s), the state at that time, and the parameter
            `smallness`, which must be small for both to be valid.

    Raises:
        ValueError: `order` is neither 1 nor 2.

    Examples:
        >>> from jaxcam.hybrid.surface import chatter_completion
        >>> from jaxcam.models import BouncingBall
        >>> float(chatter_completion(BouncingBall(), 0.0, jnp.array([0.0, 0.981])).time)
        1.0
    """
    if order not in (1, 2):
        raise ValueError(f"order is {order}; the completion map has order 1 or 2")

    t = jnp.asarray(t, dtype=jnp.float64)

    def field(s, y):
        return system.vector_field(s, y)

    def acceleration_of(s, y):
        return normal_acceleration(system, s, y)[0]

    speed = normal_velocity(system, t, state)[0]
    direction = normal_directions(system, t, state)[0]
    point = state - speed * direction
    restitution = restitution_coefficients(system, t, point)[0]
    acceleration = acceleration_of(t, point)
    rate = lie_derivative(acceleration_of, lambda s, y: sticking_field(system, s, y))(
        t, point
    )
    damping = jax.jvp(lambda y: acceleration_of(t, y), (point,), (direction,))[1]
    jerk = lie_derivative(acceleration_of, field)(t, state)
    smallness = speed * jnp.abs(jerk) / (acceleration**2 * (1 - restitution))
    if order == 1:
        duration = completion_time(speed, acceleration, 0.0, 0.0, restitution)
        return Completion(
            t + duration,
            point + duration * sticking_field(system, t, point),
            smallness,
        )
    softening = _softening(system, t, point, direction, speed, restitution)
    duration = completion_time(
        speed, acceleration, rate, damping, restitution, softening
    )
    half = point + duration / 2 * sticking_field(system, t, point)
    moved = point + duration * sticking_field(system, t + duration / 2, half)
    return Completion(t + duration, moved, smallness)


def _softening(system, t, point, direction, speed, restitution):
    """Return the slope r1 of the coefficient r0 + r1 v, from the impact before this
    rebound.
    """
    bounces = restitution > 0
    approach = speed / jnp.where(bounces, restitution, 1.0)
    after = impacts(system, t, point - approach * direction)[0]
    rebound = normal_velocity(system, t, after)[0]
    inverse = 1 / jnp.where(approach > 0, approach, 1.0)
    return jnp.where(bounces, (rebound * inverse - restitution) * inverse, 0.0)
