"""Follow ever more closely spaced impacts one by one until contact.

Flights too low for an integrator are followed with Taylor series of the full state, up
to the third power of the flight time; gaps and normal velocities are integrated
separately, so that rounding of the positions does not matter. A flight of duration s
has an error of about s^4.
"""

from typing import NamedTuple

import numpy as np


# flights up to this height are followed here; the longest lasts about 1e-4
LOW = 1e-9
# at the start of a sequence, the acceleration changes by at most this fraction during a
# flight
_STEADY = 0.05
# below this rebound speed impacts are no longer followed; the remaining height is of
# the order of its square
_LAST = 1e-12
# a gap that has risen this far above `LOW` is no longer in the sequence
_AWAY = 100.0
_MOST = 30_000


class Rest(NamedTuple):
    """The end of a sequence of low flights."""

    time: float
    state: np.ndarray
    held: tuple[int, ...]
    # (time, constraint, normal velocity before) of each impact
    impacts: list
    # whether the sequence ended in contact; otherwise its outcome is unknown
    known: bool


def is_low(dynamics, t, y, k, rebound, held) -> bool:
    """Whether the flight after an impact at gap `k` is low enough for this module."""
    _, _, pull, rise = dynamics.jets(t, y, held)
    a, j = pull[k], rise[k]
    low = a < 0 and rebound * rebound <= 2 * LOW * -a
    return low and rebound * abs(j) <= _STEADY * a * a


def follow(dynamics, t, y, k, rebound, held) -> Rest:
    """Follow the impacts from the state just after an impact at gap `k`."""
    d, m = dynamics.d, dynamics.m
    gaps, speeds = dynamics.closing(t, y)
    held = set(held)
    for row in (*held, k):
        gaps[row] = 0.0
    speeds[k] = rebound
    active, impacts = {k}, []
    for row in held:
        speeds[row] = 0.0
    y = y.copy()
    for _ in range(_MOST):
        rate, jerk, pull, rise = dynamics.jets(t, y, tuple(sorted(held)))
        free = [row for row in range(m) if row not in held]
        lively = [
            row
            for row in active - held
            if pull[row] >= 0 or speeds[row] ** 2 - 2 * pull[row] * gaps[row] > _LAST**2
        ]
        if not lively:
            ended = tuple(sorted(held | active))
            force = dynamics.pressure(t, y, ended) if ended else np.zeros(0)
            return Rest(t, y, ended, impacts, bool(np.all(force > 0)))
        hops = [
            (_landing(gaps[row], speeds[row], pull[row], rise[row]), row)
            for row in free
        ]
        length, hit = min(hops)
        if not length < 1e-2 or np.max(gaps[list(active)]) > _AWAY * LOW:
            return Rest(t, y, tuple(sorted(held)), impacts, False)
        s = length
        y[:d] += s * (rate[:d] + s / 2 * (rate[d:] + s / 3 * jerk))
        y[d:] += s * (rate[d:] + s / 2 * jerk)
        for row in free:
            g, v, a, j = gaps[row], speeds[row], pull[row], rise[row]
            gaps[row] = max(g + s * (v + s / 2 * (a + s / 3 * j)), 0.0)
            speeds[row] = v + s * (a + s / 2 * j)
        t += s
        velocity = speeds[hit]
        gaps[hit] = 0.0
        if velocity >= 0:
            # the gap only grazes
            velocity = 0.0
        impacts.append((t, hit, velocity))
        active.add(hit)
        jump = -(1 + dynamics.restitution(hit, velocity)) * velocity
        push = jump / dynamics.coupling[hit, hit]
        y[d:] += dynamics.across[:, hit] * push
        speeds += dynamics.coupling[:, hit] * push
        # an impulse may open another gap in contact, or cause an impact there
        touched = [row for row in held if abs(speeds[row]) > _LAST]
        held.difference_update(touched)
        active.update(touched)
        for row in held:
            speeds[row] = 0.0
    return Rest(t, y, tuple(sorted(held)), impacts, False)


def _landing(gap, speed, pull, rise):
    """The next zero of g + v s + a s^2/2 + j s^3/6; infinity if there is none."""
    if gap <= 0:
        if speed < 0 or (speed == 0 and pull < 0):
            return 0.0
        # the root at the start is excluded
        roots = np.roots([rise / 6, pull / 2, speed])
    else:
        roots = np.roots([rise / 6, pull / 2, speed, gap])
    real = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)].real
    later = real[real > 0]
    return float(np.min(later)) if later.size else np.inf
