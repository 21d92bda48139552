"""Reject invalid starts, traced or not, and find the sides on which motions start."""

import jax.numpy as jnp
import numpy as np

from ..codes import BACKWARD, BEHIND, NOT_FINITE, RUNNING
from ..surface import gaps, least_gaps
from ._flight import moves_in
from ._functions import Functions
from ._select import any_of


def starts_behind(system, t, state):
    """Return whether a state penetrates a constraint, and the gaps, shape `(m,)`."""
    return jnp.any(least_gaps(system, t, state) < 0), gaps(system, t, state)


def first_status(t0, x, t1, gaps, rooms):
    """Return the status of a run at its start: `RUNNING`, or the reason for an error.

    **Arguments:** times (s), the state, all gaps and their resolution (`start_room`) as
    tuples of scalars.
    """
    behind = any_of([gap + room < 0 for gap, room in zip(gaps, rooms, strict=True)])
    finite = jnp.isfinite(sum(x) + sum(gaps) + t0 + t1)
    status = jnp.where(behind, BEHIND, RUNNING)
    status = jnp.where(finite, status, NOT_FINITE)
    return jnp.where(t1 < t0, BACKWARD, status)


# a distance from a surface that the motion covers in this fraction of the period of the
# forcing over 2 pi is zero
_AT_ONCE = 1e-12


def first_sides(functions: Functions, t, x, contact, time):
    """Return the sides of the switching surfaces on which a motion starts.

    A motion that starts on a surface enters one of its sides, or slides along it. If
    both branches leave the surface, the system determines the side. For a velocity of
    zero, the forced motion provides the only scale: `time` is the period of the forcing
    over 2 pi (s), or zero.

    Returns:
        Flags of the negative sides, then of sliding; the jets of the surfaces there, as
        if the motion did not slide; whether the motion slides along a surface; and
        whether it would have to slide, but cannot.
    """
    if not functions.k:
        return (), [], False, False
    sides = list(functions.sides(t, x))
    free = (np.bool_(False),) * functions.k
    slides, stuck = list(free), jnp.asarray(False)
    touched = list(free)

    def jet_of(k, flag):
        """Return the jet of a surface on one of its sides, whether x is on the surface,
        and whether the motion then moves into it.
        """
        mode = (*contact, *sides[:k], flag, *sides[k + 1 :], *free)
        jets, roundings = functions.open_surfaces(t, x, mode)
        jet, on = rounded(k, jets[k], roundings[k])
        return jet, on, on & moves_in(jet, roundings[k])

    def rounded(k, jet, rounding):
        """Return a jet without the rounding error of a distance of zero, and whether it
        is zero.
        """
        slow = _AT_ONCE * time * jnp.abs(jet.velocity)
        on = jnp.abs(jet.gap) <= rounding + (slow if k in functions.slidable else 0.0)
        return jet._replace(gap=jnp.where(on, 0.0, jet.gap)), on

    for k in range(functions.one_way):
        crossed = [jnp.asarray(False)] * functions.k
        crossed[k] = jet_of(k, sides[k])[2]
        sides[:] = functions.turned(sides, crossed)
    for k in range(functions.one_way, functions.k):
        flag = sides[k]
        own, _, leaves = jet_of(k, flag)
        other, on, back = jet_of(k, ~flag)
        touched[k] = on
        if k in functions.slidable:
            slack = functions.slack((*contact, *sides, *free))[k]
            # rate at which the two branches together hold the motion on the surface;
            # one of them may drive it away at up to `slack` times this rate
            together = -(own.velocity + other.velocity)
            fastest = jnp.maximum(own.velocity, other.velocity)
            slides[k] = on & (together > 0) & (fastest <= slack * together)
            leaves = leaves & ~slides[k]
        else:
            stuck = stuck | (leaves & on & back)
        sides[k] = flag ^ (leaves & ~back)
    sides, slides = _held_together(functions, t, x, contact, sides, touched, slides)
    jets, roundings = functions.open_surfaces(t, x, (*contact, *sides, *free))
    pairs = enumerate(zip(jets, roundings, strict=True))
    jets = [rounded(k, *pair)[0] for k, pair in pairs]
    return (*sides, *slides), jets, any_of(slides), stuck


def _held_together(functions: Functions, t, x, contact, sides, touched, slides):
    """Return the sides, and the surfaces on which a motion slides at the start.

    Several surfaces that are touched may hold the motion together, although it would
    leave one of them if it slid past the others. The surface that is farthest from
    holding the motion is left out, again and again, until the remaining ones hold it.
    """
    if len(functions.slidable) < 2:
        return sides, slides
    several = sum(jnp.where(touched[k], 1.0, 0.0) for k in functions.slidable) > 1
    flags, trial = list(sides), list(slides)
    for k in functions.slidable:
        trial[k] = touched[k]
    for _ in functions.slidable:
        excess, shares = functions.hold(t, x, (*contact, *flags, *trial))
        worst = jnp.max(jnp.stack(excess))
        waits = (worst > 0) & several
        for k in functions.slidable:
            goes = waits & trial[k] & (excess[k] == worst)
            flags[k] = flags[k] ^ (goes & (shares[k] > 0.5))
            trial[k], waits = trial[k] & ~goes, waits & ~goes
    return (
        [jnp.where(several, a, b) for a, b in zip(flags, sides, strict=True)],
        [jnp.where(several, a, b) for a, b in zip(trial, slides, strict=True)],
    )
