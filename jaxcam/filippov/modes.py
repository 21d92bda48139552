"""Classify the motion at the surface (crossing or sliding), and find the sliding
field.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._system import FilippovSystem


def surface_rates(
    system: FilippovSystem, t, state: Float[Array, " n"]
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return the rates of change of the switching function H along both vector fields,
    including the explicit dependence of H on time (thesis, eq. 3.9).

    Args:
        system: The system.
        t: Time (s).
        state: State, shape `(n,)`.

    Returns:
        Two scalars: the rates along the fields `above` and `below`.

    Examples:
        >>> from jaxcam.filippov.modes import surface_rates
        >>> from jaxcam.models import BeltOscillator
        >>> state = jnp.array([0.5, 0.2])  # spring force 0.5, friction 1
        >>> above, below = surface_rates(BeltOscillator(belt=0.2), 0.0, state)
        >>> round(float(above), 6), round(float(below), 6)
        (-1.5, 0.5)
    """
    t = jnp.asarray(t, dtype=float)

    def along(field):
        tangents = (jnp.ones_like(t), field(t, state))
        return jax.jvp(system.switching, (t, state), tangents)[1]

    return along(system.above), along(system.below)


def sliding_share(system: FilippovSystem, t, state) -> Float[Array, ""]:
    """Return the weight of the field `above` in the sliding field; it is between 0 and
    1 if the system slides.
    """
    above, below = surface_rates(system, t, state)
    difference = below - above
    safe = jnp.where(difference == 0, 1.0, difference)
    return jnp.where(difference == 0, 0.5, below / safe)


def sliding_field(
    system: FilippovSystem, t, state: Float[Array, " n"]
) -> Float[Array, " n"]:
    """Return the sliding vector field: Filippov's convex combination of `above` and
    `below`, which is tangent to the surface.

    Args:
        system: The system.
        t: Time (s).
        state: State, shape `(n,)`.

    Returns:
        The sliding field, shape `(n,)`.

    Examples:
        >>> from jaxcam.filippov.modes import sliding_field
        >>> from jaxcam.models import BeltOscillator
        >>> system = BeltOscillator(belt=0.2)
        >>> field = sliding_field(system, 0.0, jnp.array([0.5, 0.2]))
        >>> np.asarray(field).round(6).tolist()  # the mass moves with the belt
        [0.2, 0.0]
    """
    share = sliding_share(system, t, state)
    return share * system.above(t, state) + (1 - share) * system.below(t, state)


def equivalent_control(
    system: FilippovSystem, t, state: Float[Array, " n"]
) -> tuple[Float[Array, ""], Float[Array, " n"]]:
    """Return Utkin's equivalent control u of x' = f + g u, where u is 1 above the
    surface and -1 below it, so f is the mean of the two vector fields, and g is half
    the difference `above` - `below`.

    With the switching function H, the control solves H_t + H_x (f + g u) = 0 and is in
    [-1, 1] if the system slides. Because the control enters linearly, the resulting
    field is that of Filippov. The control is the mean output of a relay; for dry
    friction, its magnitude is the friction force divided by its maximum.

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
        The kind of state, as one of these words.

    Examples:
        >>> from jaxcam.filippov.modes import region
        >>> from jaxcam.models import BeltOscillator
        >>> system = BeltOscillator(belt=0.2)
        >>> [region(system, 0.0, jnp.array([x, 0.2])) for x in (-2.0, 0.5, 2.0)]
        ['crossing up', 'sliding', 'crossing down']
    """
    above, below = (float(rate) for rate in surface_rates(system, t, state))
    if above == 0 or below == 0:
        return "tangent"
    if above > 0:
        return "crossing up" if below > 0 else "escaping"
    return "sliding" if below > 0 else "crossing down"
