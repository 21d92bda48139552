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


# a motion that would reach a surface within this fraction of the period of the forcing
# over 2 pi, and slide there, slides at once
_AT_ONCE = 1e-12


def first_sides(functions: Functions, t, x, contact, time):
    """Return the sides of the switching surfaces on which a motion starts.

    A motion that starts on a surface enters one of its sides, or slides along it. If
    both branches leave the surface, the system determines the side. A velocity of zero
    has a rounding error, for which the forced motion provides the only scale: `time` is
    the period of the forcing over 2 pi (s), or zero.

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
        """Return the jet of a surface on one of its sides, whether x is on the surface
        or would reach it at once, whether it is on it, and whether the motion then
        moves into it.
        """
        mode = (*contact, *sides[:k], flag, *sides[k + 1 :], *free)
        jets, roundings = functions.open_surfaces(t, x, mode)
        on = jnp.abs(jets[k].gap) <= roundings[k]
        jet = jets[k]._replace(gap=jnp.where(on, 0.0, jets[k].gap))
        reach = roundings[k] + _AT_ONCE * time * jnp.abs(jet.velocity)
        return jet, jnp.abs(jet.gap) <= reach, on, on & moves_in(jet, roundings[k])

    for k in range(functions.one_way):
        crossed = [jnp.asarray(False)] * functions.k
        crossed[k] = jet_of(k, sides[k])[-1]
        sides[:] = functions.turned(sides, crossed)
    for k in range(functions.one_way, functions.k):
        flag = sides[k]
        own, near, _, leaves = jet_of(k, flag)
        other, close, on, back = jet_of(k, ~flag)
        if k in functions.slidable:
            slack = functions.slack((*contact, *sides, *free))[k]
            # rate at which the two branches together hold the motion on the surface;
            # one of them may drive it away at up to `slack` times this rate
            together = -(own.velocity + other.velocity)
            fastest = jnp.maximum(own.velocity, other.velocity)
            holds = (together > 0) & (fastest <= slack * together)
            slides[k] = (near | close) & holds
            leaves = leaves & ~slides[k]
        else:
            stuck = stuck | (leaves & on & back)
        touched[k] = on | slides[k]
        sides[k] = flag ^ (leaves & ~back)
    sides, slides = _held_together(functions, t, x, contact, sides, touched, slides)
    jets, roundings = functions.open_surfaces(t, x, (*contact, *sides, *free))
    jets = [
        jet._replace(gap=jnp.where((jnp.abs(jet.gap) <= r) | on, 0.0, jet.gap))
        for jet, r, on in zip(jets, roundings, slides, strict=True)
    ]
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
