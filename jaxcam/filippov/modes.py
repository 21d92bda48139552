"""Classify the motion at the surface (crossing or sliding), and find the active
field.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._system import FilippovSystem


def surface_rates(
    system: FilippovSystem, t, state: Float[Array, " n"]
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return the rates of change of H along both fields, including time (thesis, eq.
    3.9).

    Args:
        system: The system.
        t: Time (s).
        state: State, shape `(n,)`.

    Returns:
        Two scalars, above and below.
    """
    t = jnp.asarray(t, dtype=float)

    def along(field):
        tangents = (jnp.ones_like(t), field(t, state))
        return jax.jvp(system.switching, (t, state), tangents)[1]

    return along(system.above), along(system.below)


def sliding_share(system: FilippovSystem, t, state) -> Float[Array, ""]:
    """Return the weight of the upper field in sliding; it is between 0 and 1 if the
    system slides.
    """
    above, below = surface_rates(system, t, state)
    difference = below - above
    safe = jnp.where(difference == 0, 1.0, difference)
    return jnp.where(difference == 0, 0.5, below / safe)


def sliding_field(
    system: FilippovSystem, t, state: Float[Array, " n"]
) -> Float[Array, " n"]:
    """Return Filippov's convex combination of both fields, tangent to the surface.

    Args:
        system: The system.
        t: Time (s).
        state: State, shape `(n,)`.

    Returns:
        Shape `(n,)`.
    """
    share = sliding_share(system, t, state)
    return share * system.above(t, state) + (1 - share) * system.below(t, state)


def equivalent_control(
    system: FilippovSystem, t, state: Float[Array, " n"]
) -> tuple[Float[Array, ""], Float[Array, " n"]]:
    """Return Utkin's equivalent control of x' = f + g u with u = 1 above and -1 below.

    It solves H_t + H_x (f + g u) = 0 and is in [-1, 1] if the system slides. Because
    the control enters linearly, the resulting field is that of Filippov. It is also the
    dry-friction force divided by its maximum, or the mean output of a relay.

    Args:
        system: The system.
        t: Time (s).
        state: State, shape `(n,)`.

    Returns:
        u, a scalar, and the field f + g u, shape `(n,)`.

    Examples:
        >>> from jaxcam.filippov import equivalent_control
        >>> from jaxcam.models import BeltOscillator
        >>> u, _ = equivalent_control(BeltOscillator(), 0.0, jnp.array([0.5, 0.2]))
        >>> round(float(abs(u)), 6)
        0.5
    """
    above, below = system.above(t, state), system.below(t, state)
    mean, control = (above + below) / 2, (above - below) / 2
    t = jnp.asarray(t, dtype=float)
    moved, drift = jnp.ones_like(t), jnp.zeros_like(t)
    _, free = jax.jvp(system.switching, (t, state), (moved, mean))
    _, gain = jax.jvp(system.switching, (t, state), (drift, control))
    u = -free / gain
    return u, mean + control * u


def region(system: FilippovSystem, t, state: Float[Array, " n"]) -> str:
    """Classify a state on the surface.

    A state is "crossing up", "crossing down", "sliding" (both fields point towards the
    surface), "escaping" (both point away, so the motion is not unique), or "tangent".

    Args:
        system: The system.
        t: Time (s).
        state: State, shape `(n,)`.

    Returns:
        One of these words.
    """
    above, below = (float(rate) for rate in surface_rates(system, t, state))
    if above == 0 or below == 0:
        return "tangent"
    if above > 0:
        return "crossing up" if below > 0 else "escaping"
    return "sliding" if below > 0 else "crossing down"


def mode_field(system: FilippovSystem, mode, t, state) -> Float[Array, " n"]:
    """Return the active field: mode 1 above the surface, -1 below it, 0 sliding on it.

    Args:
        system: The system.
        mode: The mode.
        t: Time (s).
        state: State, shape `(n,)`.

    Returns:
        Shape `(n,)`.
    """
    share = jnp.where(mode == 0, sliding_share(system, t, state), (mode + 1.0) / 2)
    return share * system.above(t, state) + (1 - share) * system.below(t, state)


def levels(system: FilippovSystem, mode, t, state) -> Float[Array, " 2"]:
    """Return the quantities that remain positive in a mode: H, or both inward rates.

    On one side of the surface, the second level is always 1.
    """
    above, below = surface_rates(system, t, state)
    height = mode * system.switching(t, state)
    sliding = jnp.stack([-above, below])
    return jnp.where(mode == 0, sliding, jnp.stack([height, jnp.ones_like(height)]))


def onto_surface(system: FilippovSystem, t, state) -> Float[Array, " n"]:
    """Move the state to the surface along its gradient."""
    value, gradient = jax.value_and_grad(system.switching, argnums=1)(t, state)
    return state - value * gradient / jnp.sum(gradient * gradient)


def mode_after(system: FilippovSystem, mode, level, t, state):
    """Return the mode in which a motion continues from an event on the surface.

    Motion on one side ends in crossing or sliding. Sliding ends when one of the fields
    begins to point away from the surface; the motion then continues on the side of that
    field.
    """
    above, below = surface_rates(system, t, state)
    down = jnp.where(below < 0, -1.0, 0.0)
    up = jnp.where(above > 0, 1.0, 0.0)
    left = jnp.where(level == 0, 1.0, -1.0)
    return jnp.where(mode > 0, down, jnp.where(mode < 0, up, left))


def first_mode(system: FilippovSystem, t, state):
    """Return the initial mode; escaping counts as above."""
    height = system.switching(t, state)
    above, below = surface_rates(system, t, state)
    on = jnp.abs(height) <= 1e-12 * (1.0 + jnp.max(jnp.abs(state)))
    slides = (above < 0) & (below > 0)
    surface = jnp.where(slides, 0.0, jnp.where(above > 0, 1.0, -1.0))
    return jnp.where(on, surface, jnp.where(height > 0, 1.0, -1.0))
