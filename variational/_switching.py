"""Propagate perturbations through the events at a switching surface."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxcam.hybrid import SwitchedSystem
from jaxcam.hybrid.programs import is_traced
from jaxcam.hybrid.surface import InMode, Jumps, OnSides, resets, switching_distances
from jaxcam.parameters import VectorLike

from ._event_law import event_crossing


def switching_saltation(
    system: SwitchedSystem,
    t,
    state: Float[Array, " n"],
    sides: VectorLike,
    surface: int = 0,
    *,
    after: float | None = None,
) -> Float[Array, "n n"]:
    """Return the saltation matrix of an event at a switching surface, with no
    constraint in contact.

    With F- and F+ the vector field before and after the event, h the switching
    function, and R the reset (the identity unless the system has one),

        S = R_x + (F+ - R_t - R_x F-) h_x / (h_t + h_x F-),

    where subscripts denote partial derivatives, including those with respect to time.
    Where the field is continuous, as in a bilinear oscillator, S is the identity. At
    the beginning of sliding, the rank of S falls by one, because perturbations are
    projected onto the surface. At the end of sliding, h is the function whose zero ends
    the sliding, and S is the identity unless the `holding` of the system exceeds one.
    (R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical
    Systems, 2004, chapter 7)

    Args:
        system: The system.
        t: Time of the event (s).
        state: State at the event, shape `(n,)`.
        sides: Side of each surface on which the motion is before the event, +1 or -1,
            or 0 while it slides along the surface, shape `(k,)`. If the values are
            traced, the event is taken to be a crossing.
        surface: Index of the surface of the event.
        after: Side of this surface after the event, 0 if sliding begins; default: the
            other side.

    Returns:
        The matrix, shape `(n, n)`.

    Raises:
        ValueError: The motion slides before the event and `after` is not given.

    Examples:
        >>> from jaxcam.models import BilinearOscillator
        >>> from variational import switching_saltation
        >>> state, sides = jnp.array([0.0, 1.0]), jnp.array([-1.0])
        >>> switching_saltation(BilinearOscillator(), 0.0, state, sides).tolist()
        [[1.0, 0.0], [0.0, 1.0]]
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    x = jnp.asarray(state, dtype=jnp.float64)
    traced = is_traced((sides, after))
    xp = jnp if traced else np
    old = xp.asarray(sides, dtype=xp.float64)
    if after is None and not traced and old[surface] == 0:
        raise ValueError(
            "the motion slides before the event; pass the side on which it continues, "
            "such as after=1.0"
        )
    changed = (
        (surface,) if after is not None else system.sides_changed(len(old))[surface]
    )
    here = np.isin(np.arange(old.shape[0]), changed)
    new = xp.where(here, -old if after is None else after, old)
    slides = not traced and (old[surface] == 0 or new[surface] == 0)
    before, beyond = _in_mode(system, old, x), _in_mode(system, new, x)
    reset_from = OnSides(system, before.negative)
    law_x, moved, normal, speed = event_crossing(
        lambda s, y: y if slides else resets(reset_from, s, y)[surface],
        lambda s, y: switching_distances(before, s, y)[surface],
        before.vector_field,
        beyond.vector_field,
        t,
        x,
    )
    return law_x + jnp.outer(moved, normal) / speed


def _in_mode(system: SwitchedSystem, sides, x) -> InMode:
    """Return the system on these sides, sliding where a side is zero."""
    every = tuple(range(x.shape[0]))
    # whether the motion slides must be known while tracing
    held = [not is_traced(side) and side == 0 for side in sides]
    changed = tuple(every if slides else () for slides in held)
    flat: Bool[Array, " m"] = jnp.zeros((0,), bool)
    flags = jnp.asarray(sides) < 0, jnp.asarray(held)
    return InMode(system, *flags, flat, Jumps(changed, changed))
