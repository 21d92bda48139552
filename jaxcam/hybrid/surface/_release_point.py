"""Find the release from sticking, at which a period with complete chatter starts."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._normal import free_jet, gaps, normal_acceleration, normal_velocity


class ReleasePoint(eqx.Module):
    """The time and state at which contact ends.

    `holds`: 0 for a release, 1 if contact is maintained at the given time, 2 if there
    is no contact.
    """

    time: Float[Array, ""]
    """Time of release (s)."""
    state: Float[Array, " n"]
    """State at release, shape `(n,)`."""
    holds: Float[Array, ""]
    """0 for a release, 1 if contact is maintained at the given time, 2 if there is no
    contact.
    """


def contact_state(system: HybridSystem, times, guess) -> Float[Array, "times n"]:
    """Return the state of sustained contact at each of `times`.

    Newton's method finds the state for which the gap and the normal velocity are zero.

    Args:
        system: A system with two states and one constraint.
        times: Times (s), shape `(times,)`.
        guess: State from which Newton's method starts, shape `(n,)`.

    Returns:
        States, shape `(times, n)`.

    Examples:
        >>> from jaxcam.hybrid.surface import contact_state
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(wall=0.5)
        >>> contact_state(system, jnp.zeros(1), jnp.zeros(2)).tolist()
        [[0.5, 0.0]]
    """
    return _contact(system, jnp.asarray(times), guess)[0]


def contact_acceleration(system: HybridSystem, times, guess) -> Float[Array, " times"]:
    """Return the normal acceleration suppressed by contact at each of `times`.

    Contact is maintained while this acceleration is negative; the body detaches if the
    maximum of the acceleration over the period is positive.

    Args:
        system: A system with two states and one constraint.
        times: Times (s), shape `(times,)`.
        guess: State from which Newton's method starts, shape `(n,)`.

    Returns:
        Accelerations, shape `(times,)`.

    Examples:
        >>> from jaxcam.hybrid.surface import contact_acceleration
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(wall=0.5)
        >>> contact_acceleration(system, jnp.zeros(1), jnp.zeros(2)).tolist()
        [-0.5]
    """
    return _contact(system, jnp.asarray(times), guess)[1]


def _contact(system: HybridSystem, times, guess):
    """Return the states and accelerations in contact, by twelve Newton steps each."""

    def one(t):
        x = jax.lax.fori_loop(0, 12, lambda _, x: _onto(system, t, x), guess)
        return x, normal_acceleration(system, t, x)[0]

    return jax.vmap(one)(times)


def _onto(system: HybridSystem, t: RealScalar, x: State) -> State:
    """Take one Newton step of the two states towards gap = normal velocity = 0."""

    def both(y):
        return gaps(system, t, y)[0], normal_velocity(system, t, y)[0]

    gap, velocity = both(x)
    (a, b), (c, d) = jax.jacfwd(both)(x)
    step = jnp.stack([d * gap - b * velocity, a * velocity - c * gap])
    return x - step / (a * d - b * c)


def release_point(
    system: HybridSystem, t: RealScalar, guess=None, samples: int = 512
) -> ReleasePoint:
    """Return the last release at or before `t`, found by a scan over one period.

    Args:
        system: A system with a `period`, two states and one constraint.
        t: Time (s).
        guess: Initial guess near the surface for Newton's method, shape `(n,)`; default
            zeros.
        samples: Number of points in the scan.

    Returns:
        The release, with `holds` = 0. If contact is maintained at `t`, the state of
            contact at `t`, with `holds` = 1; `holds` is 2 if there is no contact.

    Examples:
        >>> from jaxcam.hybrid.surface import release_point
        >>> from jaxcam.models import ImpactOscillator
        >>> release = release_point(ImpactOscillator(omega=1.0, wall=0.5), 3.0)
        >>> round(float(release.time), 6)
        1.047198
    """
    system = system.prepared()
    guess = jnp.zeros(2) if guess is None else guess
    t = jnp.asarray(t, dtype=jnp.float64)
    grid = t - system.period * jnp.linspace(1.0, 0.0, samples + 1)
    states, values = _contact(system, grid, guess)
    held = values[-1] < 0
    rises = (values[:-1] < 0) & (values[1:] >= 0)
    last = jnp.where(jnp.any(rises), samples - 1 - jnp.argmax(rises[::-1]), 0)
    low, high = grid[last], grid[last + 1]
    # the chord is close enough for Newton's method, which also carries the derivative
    rise = values[last + 1] - values[last]
    share = -values[last] / jnp.where(rises[last], rise, 1.0)
    start = jax.lax.stop_gradient(low + share * (high - low))

    def newton(_, carry):
        time, x = carry
        _, _, acceleration, jerk = free_jet(system, time, x)[0]
        slope = jnp.where(jerk > 0, jerk, jnp.inf)
        moved = jnp.clip(time - acceleration / slope, low, high)
        return jnp.where(held, t, moved), _onto(system, time, x)

    first = jnp.where(held, t, start)
    from_grid = jnp.where(held, states[-1], states[last])
    time, x = jax.lax.fori_loop(0, 16, newton, (first, from_grid))
    never = ~held & ~jnp.any(rises)
    holds = jnp.where(never, 2.0, jnp.where(held, 1.0, 0.0))
    return ReleasePoint(time, x, holds)
