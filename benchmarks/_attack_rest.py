"""Follow impacts in ever shorter succession, one by one, until contact.

Flights too low for an integrator are followed with Taylor series of the full state, to
the third power of their length; gaps and normal velocities are integrated separately,
so that the rounding of positions does not matter. A flight of duration s has an error
of about s^4.
"""

from typing import NamedTuple

import numpy as np


#: hops at most this high are followed here: the longest then lasts about 1e-4
LOW = 1e-9
# and at the start a hop changes its acceleration by at most this fraction
_STEADY = 0.05
# rebound speeds that are no longer followed: what is left of the motion is its square
_LAST = 1e-12
# a gap that has risen this much above `LOW` has left for good
_AWAY = 100.0
_MOST = 30_000


class Rest(NamedTuple):
    """The end of a sequence of low flights."""

    time: float
    state: np.ndarray
    held: tuple[int, ...]
    # (time, constraint, normal velocity before) of each impact
    impacts: list
    # whether it ended in contact; else it is not known what happens
    known: bool


def is_low(dynamics, t, y, k, rebound, held) -> bool:
    """Whether the flight after an impact at gap `k` is low enough for this method."""
    _, _, pull, rise = dynamics.jets(t, y, held)
    a, j = pull[k], rise[k]
    low = a < 0 and rebound * rebound <= 2 * LOW * -a
    return low and rebound * abs(j) <= _STEADY * a * a


def follow(dynamics, t, y, k, rebound, held) -> Rest:
    """Impact after impact from the state just after one at gap `k`."""
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
            # it only touches
            velocity = 0.0
        impacts.append((t, hit, velocity))
        active.add(hit)
        jump = -(1 + dynamics.restitution(hit, velocity)) * velocity
        push = jump / dynamics.coupling[hit, hit]
        y[d:] += dynamics.across[:, hit] * push
        speeds += dynamics.coupling[:, hit] * push
        # an impulse may throw the system off another gap, or press it on
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
        # the root at the start is left out
        roots = np.roots([rise / 6, pull / 2, speed])
    else:
        roots = np.roots([rise / 6, pull / 2, speed, gap])
    real = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)].real
    later = real[real > 0]
    return float(np.min(later)) if later.size else np.inf
