"""Integrate free flight together with its normal velocity and gap.

The gap z and the normal velocity v obey z' = v and v' = a, where a is the normal
acceleration in free flight; a flight starts at the surface with the rebound speed.
Integrated with the state, they retain their relative accuracy when the gap computed
from the state has lost it, so impacts after flights of height 1e-12 are as accurate as
those after high flights.
"""

import jax.numpy as jnp
from jaxtyping import ArrayLike

from jaxcam import HybridSystem
from jaxcam.hybrid.runge_kutta import adaptive_steps, array_step, DOPRI8
from jaxcam.hybrid.surface import normal_acceleration


TOLERANCE = 1e-14
"""Allowed error of a step, relative to one plus the state."""


def runge_kutta_step(rates, s, y, h):
    """Return the state after one step of length `h`, and the error estimate."""
    return array_step(DOPRI8, rates, s, y, h)[:2]


def flight_rates(system: HybridSystem, time: ArrayLike = 0.0):
    """Return the function `rates(s, y)` of free flight. Here, s is the time since
    `time`, and y, shape `(n + 2,)`, contains state, normal velocity and gap.
    """

    def rates(s, y):
        t, x = time + s, y[:-2]
        push = normal_acceleration(system, t, x)
        return jnp.concatenate([system.vector_field(t, x), push, y[-2:-1]])

    return rates


def on_flight(state, speed, height: ArrayLike = 0.0):
    """Return the integrated quantities (state, normal velocity, gap) in one vector."""
    beside = jnp.stack([jnp.asarray(b, jnp.float64) for b in (speed, height)])
    return jnp.concatenate([state, beside])


def fly(system: HybridSystem, time, state, speed, duration, height: ArrayLike = 0.0):
    """Integrate a free flight of given duration, without event detection.

    Args:
        system: The system, already `prepared`.
        time: Time of the start (s).
        state: State, shape `(n,)`.
        speed: Normal velocity at the start.
        duration: Duration of the flight (s), >= 0.
        height: Gap at the start.

    Returns:
        State `(n,)`, gap and normal velocity at the end; the gap retains its relative
            accuracy if the flight starts on the surface.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational.chatter import fly
        >>> start = jnp.array([1.0, 0.0])
        >>> _, gap, velocity = fly(BouncingBall(), 0.0, start, 0.0, 0.2, height=1.0)
        >>> round(float(gap), 6), round(float(velocity), 6)  # 1 - g t^2 / 2 and -g t
        (0.8038, -1.962)
    """
    rates = flight_rates(system, jnp.asarray(time, jnp.float64))
    y = on_flight(state, speed, height)
    y = adaptive_steps(DOPRI8, rates, jnp.zeros(()), y, duration, TOLERANCE)
    return y[:-2], y[-1], y[-2]
