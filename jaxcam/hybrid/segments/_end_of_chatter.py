"""Complete impacts that accumulate on one or several constraints, in the second
engine.
"""

from typing import NamedTuple

import numpy as np

from ..surface import LOSSY_RATIO, SHORT_FLIGHT, SLOW_REBOUND
from ._motion import CompiledMotion


class Rebound(NamedTuple):
    """The motion just after an impact on the constraint `hit`."""

    time: float
    state: np.ndarray
    hit: int
    # constraints in contact `(m,)`
    contact: np.ndarray
    # normal velocities before and after the impact, each `(m,)`
    speeds: list[np.ndarray]
    # fastest rebound so far
    fastest: float


class Rest(NamedTuple):
    """The state at rest, its time (s), and the constraints in contact `(m,)`."""

    time: float
    state: np.ndarray
    contact: np.ndarray


def end_of_chatter(
    motion: CompiledMotion,
    rebound: Rebound,
    depth: float,
    tiny,
    longest,
    several: bool = False,
) -> Rest | None:
    """Return the `Rest` after the remaining impacts, if these may be completed now.

    **Arguments:** the relative rebound speed at which a chatter is completed (`depth`);
    the resolution of each gap (`tiny`); the longest step (s); and whether `several`
    constraints are hit at once, for which there is no formula.
    """
    before, after = (float(speeds[rebound.hit]) for speeds in rebound.speeds)
    after = max(after, 0.0)
    if len(rebound.contact) > 1 and before < 0:
        rest = _joint_end(motion, rebound, after / -before, tiny, longest)
        if rest is not None:
            return rest
    if several or after > depth * rebound.fastest:
        return None
    t, k, contact = rebound.time, rebound.hit, rebound.contact.copy()
    end = motion.completion(t, rebound.state, contact, k, after, -before)
    if not (
        bool(end.possible) and _stays_alone(motion, rebound, float(end.duration), tiny)
    ):
        return None
    contact[k] = True
    return Rest(t + float(end.duration), np.asarray(end.state), contact)


def _joint_end(motion, rebound: Rebound, ratio, tiny, longest) -> Rest | None:
    """Return the `Rest` on several constraints, if the flights left are negligible.

    **Arguments:** the `ratio` of rebound to approach; others as in `end_of_chatter`.
    """
    t, x, hit, contact = rebound[:4]
    jets = np.asarray(motion.jets(t, x))
    gap, speed = np.abs(jets[:, 0]), np.abs(jets[:, 1])
    gap[hit] = 0.0
    short = (SHORT_FLIGHT * longest) ** 2
    pull = np.max(np.abs(jets[:, 2]))
    for _ in range(2):
        # first with the acceleration of free flight, then with that of contact
        height = np.maximum(short * pull, tiny)
        least = (SLOW_REBOUND * rebound.fastest) ** 2
        near = (gap <= height) & (speed**2 <= np.maximum(height * pull, least))
        closing = near & ~contact
        if ratio >= LOSSY_RATIO or not closing[hit] or np.sum(closing) < 2:
            return None
        touching = closing | contact
        state, multipliers = motion.joint_rest(t, x, touching)
        if np.any(np.asarray(multipliers)[touching] > 0):
            return None
        pull = np.where(touching, -np.asarray(multipliers), pull)
    return Rest(t, np.asarray(state), touching)


def _stays_alone(motion, rebound: Rebound, length: float, tiny) -> bool:
    """Return whether no other gap closes while a chatter lasts, for `length` (s).

    Over such a short time, a gap is a parabola in time, whose acceleration includes the
    effect of the mean force of the remaining impacts.
    """
    t, x, hit, contact, speeds = rebound[:5]
    gap, speed, free, _ = np.asarray(motion.jets(t, x)).T
    jump = speeds[1] - speeds[0]
    mean = free - free[hit] * jump / jump[hit] if jump[hit] > 0 else free
    left = gap + length * (speed + length * np.minimum(free, mean) / 2)
    rises = speed + length * np.minimum(free, mean) > 0
    # also clear: a body that leaves the constraint, and still does at the end
    clear = contact | (left > 0) | (rises & (gap >= -tiny))
    clear[hit] = True
    return bool(np.all(clear))
