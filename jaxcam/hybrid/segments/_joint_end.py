"""End impacts that accumulate on one or several constraints, in the second engine."""

from typing import NamedTuple

import numpy as np

from ._motion import CompiledMotion


# Flights shorter than this fraction of the longest step are negligible
_SHORT = 1e-8
# Normal velocities below this fraction of the fastest rebound are negligible
_SLOW = 1e-13
# Largest ratio of the normal velocities at an impact that loses energy
_LOSSY = 1 - 1e-9


class JointEnd(NamedTuple):
    """The state at rest, its time (s), and the constraints in contact `(m,)`."""

    time: float
    state: np.ndarray
    contact: np.ndarray


def joint_end(
    motion: CompiledMotion, t, x, hit: int, contact, ratio, fastest, tiny, longest
) -> JointEnd | None:
    """Return the rest on several constraints, if what precedes it is negligible.

    **Arguments:** the state just after an impact on the constraint `hit`; the
    constraints in `contact`; the `ratio` of rebound to approach; the `fastest` rebound
    so far; the resolution of each gap; and the longest step (s).
    """
    jets = np.asarray(motion.jets(t, x))
    gap, speed = np.abs(jets[:, 0]), np.abs(jets[:, 1])
    gap[hit] = 0.0
    short = (_SHORT * longest) ** 2
    pull = np.max(np.abs(jets[:, 2]))
    for _ in range(2):
        # first with the acceleration of free flight, then with that of contact
        height = np.maximum(short * pull, tiny)
        slow = speed**2 <= np.maximum(height * pull, (_SLOW * fastest) ** 2)
        near = (gap <= height) & slow
        closing = near & ~contact
        if ratio >= _LOSSY or not closing[hit] or np.sum(closing) < 2:
            return None
        touching = closing | contact
        state, multipliers = motion.joint_rest(t, x, touching)
        if np.any(np.asarray(multipliers)[touching] > 0):
            return None
        pull = np.where(touching, -np.asarray(multipliers), pull)
    return JointEnd(t, np.asarray(state), touching)


def stays_alone(
    motion: CompiledMotion, t, x, hit: int, contact, speeds, length
) -> bool:
    """Return whether no other gap closes during a chatter on the constraint `hit`.

    Over such a short time a gap is a parabola, whose acceleration includes the mean
    force of the remaining impacts.

    **Arguments:** the state just after an impact; the normal velocities before and
    after it, two `(m,)`; and the `length` of the chatter (s).
    """
    gap, speed, free, _ = np.asarray(motion.jets(t, x)).T
    jump = speeds[1] - speeds[0]
    mean = free - free[hit] * jump / jump[hit] if jump[hit] > 0 else free
    left = gap + length * (speed + length * np.minimum(free, mean) / 2)
    clear = contact | (left > 0)
    clear[hit] = True
    return bool(np.all(clear))
