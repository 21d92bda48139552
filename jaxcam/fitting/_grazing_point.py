"""The parameter at which an orbit touches a constraint without speed.

A graze is a point of the orbit on the surface that moves along it, H = v = 0, with free
flight on both sides. With the k impacts that the orbit has besides, its time and state
and the parameter are the unknowns of a smooth system of equations: the square root of a
grazing bifurcation is in the orbits behind it, not in the graze.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from ..hybrid import HybridSystem, normal_velocity
from ._impact_orbit import durations_of, fly, ImpactOrbit
from ._implicit import implicit_root
from ._special_points import SpecialPoint


def graze_of_orbit(
    system: HybridSystem,
    where: Callable[[Any], Any],
    guess: ImpactOrbit,
    *,
    turns: int = 1,
    constraint: int = 0,
    grazed: int | None = None,
    steps: int = 32,
) -> SpecialPoint:
    """The parameter at which a periodic orbit grazes, differentiable in all others.

    **Arguments:**

    - `system`: near the graze; `where` picks the parameter.
    - `guess`: the graze first, then the impacts of the orbit in the order in which
        they follow it, up to one period later; the graze alone for an orbit without
        impacts.
    - `turns`, `constraint`, `steps`: as in [`jaxcam.fitting.impact_orbit`][].
    - `grazed`: the constraint that is touched, where it is not the one that is hit.

    **Returns:** the orbit begins with the graze. NaN where Newton's method does not
    converge. That the gap has a minimum there, not a maximum, and is open elsewhere is
    not looked at; see [`jaxcam.hybrid.normal_acceleration`][].
    """
    touched = constraint if grazed is None else grazed
    number = guess.number
    last = jnp.arange(number) == number - 1

    def residual(unknowns):
        moved = eqx.tree_at(where, system, unknowns[-1])
        orbit = ImpactOrbit.from_vector(unknowns[:-1], number)
        durations = durations_of(moved, orbit, turns)

        def arc(t, state, duration, following, to_graze):
            end = fly(moved, t, state, duration, steps)
            after = jnp.atleast_2d(moved.impact(t + duration, end))[constraint]
            return jnp.where(to_graze, end, after) - following

        def gaps(t, state):
            return jnp.atleast_1d(moved.gap(t, state))

        following = jnp.roll(orbit.states, -1, axis=0)
        closes = jax.vmap(arc)(orbit.times, orbit.states, durations, following, last)
        at = jax.vmap(gaps)(orbit.times, orbit.states)
        speed = normal_velocity(moved, orbit.times[0], orbit.states[0])
        return jnp.concatenate(
            [
                closes.ravel(),
                at[:1, touched],
                at[1:, constraint],
                speed[touched, None],
            ]
        )

    start = jnp.append(guess.to_vector(), jnp.asarray(where(system)))
    root = implicit_root(residual, start)
    return SpecialPoint(root[-1], ImpactOrbit.from_vector(root[:-1], number))
