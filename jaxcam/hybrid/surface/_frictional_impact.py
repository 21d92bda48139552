"""Impulses of an impact with Coulomb friction at one contact.

In the course of an impact, the normal impulse P grows and the state changes in
proportion. With the slip velocity s and the normal velocity v, this is a
piecewise-smooth system in two variables with P as its time (Routh's method): the slip
decreases at a constant rate until it is zero; then it remains zero if friction suffices
(the condition of Filippov for sliding), otherwise it reverses. The chosen
hypothesis of restitution (Newton, Poisson or Stronge) determines where the impact ends.

The fourth law (Moreau) considers only the velocities after the impact: it uses Newton's
coefficient, and all of the friction opposes the slip after the impact.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp


class Rates(NamedTuple):
    """Changes of the slip and normal velocities, per unit of normal impulse, while the
    slip is positive, and while it is negative.
    """

    positive: tuple[Any, Any]
    negative: tuple[Any, Any]


class Impulses(NamedTuple):
    """The normal impulse, and its parts during positive and negative slip.

    While the slip remains zero, the normal impulse is divided between these two parts.
    """

    total: Any
    positive: Any
    negative: Any


def impulses(side, slip, approach, restitution, rates: Rates, kind: str) -> Impulses:
    """Return the impulses of an impact.

    **Arguments:**

    - `side` (+1 or -1): sign of the slip velocity, whose magnitude is `slip`.
    - `approach`: normal velocity before the impact, negative.
    - `restitution`: the coefficient of restitution.
    - `kind`: `"kinematic"` (Newton), `"kinetic"` (Poisson), `"energetic"` (Stronge) or
        `"complementarity"` (Moreau).

    **References:** W. J. Stronge, Impact Mechanics (2000); J. B.
    Keller, Impact with friction, Journal of Applied Mechanics 53 (1986), 1-4.
    """
    if kind == "complementarity":
        return _by_final_slip(side * slip, -(1 + restitution) * approach, rates)
    before = _of_side(side > 0, rates)
    # rate at which the slip decreases, and normal impulse at which it ends
    closing = -side * before[0]
    slows = closing > 0
    first = jnp.where(slows, slip / jnp.where(slows, closing, 1.0), jnp.inf)
    # afterwards, there is no slip if friction prevents it in both directions; otherwise
    # it reverses (or begins, if it was zero)
    (s1, v1), (s2, v2) = rates
    holds = (s1 <= 0) & (s2 >= 0)
    span = jnp.where(holds & (s2 > s1), s2 - s1, 1.0)
    share = jnp.where(holds, jnp.where(s2 > s1, s2 / span, 0.5), 0.0)
    share = jnp.where(holds, share, jnp.where(s2 >= 0, 1.0, 0.0))
    slopes = before[1], share * v1 + (1 - share) * v2
    total = _END[kind](approach, restitution, first, *slopes)
    start = jnp.minimum(first, total)
    rest = total - start
    positive = jnp.where(side > 0, start, 0.0) + share * rest
    return Impulses(total, positive, total - positive)


def _by_final_slip(slip, change, rates: Rates) -> Impulses:
    """Return the impulses that change the normal velocity by `change`, with friction
    that opposes the slip after the impact.
    """
    (s1, v1), (s2, v2) = rates
    # in a Painleve configuration, a normal impulse may not push the body away
    ahead = change / jnp.where(v1 > 0, v1, 1.0)
    behind = change / jnp.where(v2 > 0, v2, 1.0)
    forward = (v1 > 0) & (slip + s1 * ahead >= 0)
    backward = (v2 > 0) & (slip + s2 * behind <= 0)
    # if the contact sticks, both velocities after the impact are known
    sticks = ~(forward | backward)
    both = jnp.where(sticks, s2 * v1 - s1 * v2, 1.0)
    held = jnp.where(sticks, slip, 0.0)
    positive = (change * s2 + held * v2) / both
    negative = -(change * s1 + held * v1) / both
    positive = jnp.where(forward, ahead, jnp.where(backward, 0.0, positive))
    negative = jnp.where(forward, 0.0, jnp.where(backward, behind, negative))
    return Impulses(positive + negative, positive, negative)


def _of_side(positive, rates: Rates):
    return tuple(jnp.where(positive, a, b) for a, b in zip(*rates, strict=True))


def _reaching(velocity, approach, first, slope, later):
    """Return the normal impulse at which the normal velocity reaches a given value.

    Per unit of impulse, the velocity increases by `slope` until the slip ends at the
    impulse `first`, and by `later` after that.
    """
    change = velocity - approach
    # the first slope may be negative: then only the second phase ends the approach
    early = jnp.where(slope > 0, change / jnp.where(slope > 0, slope, 1.0), jnp.inf)
    reached = jnp.where(jnp.isfinite(first), first, 0.0)
    late = reached + (change - slope * reached) / later
    return jnp.where(early <= first, early, late)


def _kinematic(approach, restitution, first, slope, later):
    return _reaching(-restitution * approach, approach, first, slope, later)


def _kinetic(approach, restitution, first, slope, later):
    stopped = _reaching(0.0 * approach, approach, first, slope, later)
    return (1 + restitution) * stopped


def _energetic(approach, restitution, first, slope, later):
    """Return the impulse for which the work of the normal force in restitution is e^2
    times that in compression.
    """
    stopped = _reaching(0.0 * approach, approach, first, slope, later)
    bounded = jnp.isfinite(first)
    reached = jnp.where(bounded, first, 0.0)
    # whether the first phase, until the slip ends, lasts beyond compression
    lasts = first >= stopped
    rate = jnp.where(lasts, slope, 1.0)
    between = approach + slope * reached
    # twice the work in compression, and twice the work wanted in restitution
    two = between**2 / later - (approach + between) * reached
    wanted = restitution**2 * jnp.where(lasts, approach**2 / rate, two)
    # largest impulse that the first phase can add in restitution
    ahead = jnp.where(lasts & bounded, reached - stopped, 0.0)
    most = rate * ahead**2
    alone = lasts & (~bounded | (wanted <= most))
    speed = jnp.where(lasts, rate * ahead, 0.0)
    end = _root(speed**2 + later * jnp.where(alone, 0.0, wanted - most))
    return stopped + jnp.where(
        alone, _root(wanted / rate), ahead + (end - speed) / later
    )


def _root(square):
    """Return a square root with a finite derivative at zero."""
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)


_END = {"kinematic": _kinematic, "kinetic": _kinetic, "energetic": _energetic}
