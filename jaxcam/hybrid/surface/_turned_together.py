"""Friction forces of the feet of a rigid body, which change their signs together.

The normal forces of a body on several feet depend on all friction forces, so the effect
of reversing all of them differs from the sum of the effects of reversing each.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool

from ._contact_forces import ContactForces
from ._equal_slips import Tie


class Turned(NamedTuple):
    """The contact forces on the sides of the motion, and their changes beyond each
    surface, with a leading axis over the surfaces.
    """

    own: ContactForces
    beyond: ContactForces


def turned_together(
    negative: Bool[Array, " k"],
    chosen: Sequence[int],
    tied: Sequence[Tie],
    forces_on: Callable[[Bool[Array, " k"]], ContactForces],
    found: Turned,
) -> Turned:
    """Return the forces such that they are exact at both limits of tied surfaces.

    The weights of tied surfaces vary together, between two limits: in the first, the
    surfaces that slip in the opposite direction of the first one are turned; in the
    second, all others are. The differences from the sums of single changes are assigned
    to the sides of the motion and to the first surface.

    **Arguments:** the negative sides of all surfaces; the surfaces on which the motion
    can slide, and the ties between them; the forces on any sides; and the forces that
    are found if surfaces are turned one by one.
    """
    own, beyond = found
    for q in range(len(chosen) - 1):
        members = [one for one in tied if one.first == q]
        any_tied = jnp.any(jnp.stack([one.equal for one in members]))
        limits = []
        for sign in (-1.0, 1.0):
            turns = {one.second: one.equal & (one.sign == sign) for one in members}
            if sign > 0:
                turns[q] = any_tied
            flags = [negative[k] for k in range(len(negative))]
            apart = found.own
            for place, turn in turns.items():
                flags[chosen[place]] = flags[chosen[place]] ^ turn
                apart = ContactForces(
                    *(
                        a + jnp.where(turn, b[place], jnp.zeros_like(a))
                        for a, b in zip(apart, found.beyond, strict=True)
                    )
                )
            exact = forces_on(jnp.stack(flags))
            pairs = zip(exact, apart, strict=True)
            limits.append(
                [jnp.where(any_tied, a - b, jnp.zeros_like(a)) for a, b in pairs]
            )
        first, last = limits
        own = ContactForces(*(a + b for a, b in zip(own, first, strict=True)))
        rows = zip(beyond, first, last, strict=True)
        beyond = ContactForces(*(a.at[q].add(c - b) for a, b, c in rows))
    return Turned(own, beyond)
