"""Find the first event within one step of an integrator by searching a fine grid.

A gap is assumed to have at most one extremum between two grid points. A minimum is
found as a root of the normal velocity, so a dip below zero between two points is not
missed.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar


# after a release, a gap is ignored until it exceeds this value
CLEAR = 1e-9
# number of intervals into which a step is divided for the search
_PARTS = 24
_ROOT = dict(xtol=1e-15, rtol=4 * np.finfo(float).eps, maxiter=300)


class Event(NamedTuple):
    """An impact (the gap closes) or a release (the contact force vanishes)."""

    time: float
    kind: str
    constraint: int


def first_event(dynamics, dense, begin, end, held, fresh, blind) -> Event | None:
    """The first event in (begin, end], or `None`.

    **Arguments:** `dense(times)`, states in columns; `held`, the gaps in contact;
    `fresh`, the gaps that rebounded from an impact exactly at `begin`; `blind`, the
    gaps that opened by a release and are still near the surface.
    """
    times = np.linspace(begin, end, _PARTS + 1)
    states = dense(times)
    gaps, speeds = dynamics.gaps(times, states)
    found = []
    for k in range(dynamics.m):
        if k not in held:
            # skip the part of the step in which a released gap is near its surface
            clear = np.flatnonzero(gaps[:, k] > CLEAR) if k in blind else [0]
            if not len(clear):
                continue
            rest = slice(clear[0], None)
            parts = times[rest], gaps[rest, k], speeds[rest, k]
            root = _closing(dynamics, dense, *parts, k, k in fresh)
            if root is not None:
                found.append(Event(root, "impact", k))
    for k in held:
        root = _letting_go(dynamics, dense, times, held, k)
        if root is not None:
            found.append(Event(root, "release", k))
    return min(found, default=None)


def _closing(dynamics, dense, times, gaps, speeds, k, fresh):
    """The first root of gap `k`, excluding the one at the start of a new flight."""

    def gap(t):
        return dynamics.gaps(np.array([t]), dense(np.array([t])))[0][0, k]

    def speed(t):
        return dynamics.gaps(np.array([t]), dense(np.array([t])))[1][0, k]

    for i in range(len(times) - 1):
        a, b = times[i], times[i + 1]
        first = fresh and i == 0
        if gaps[i + 1] < 0:
            if not first:
                return _root(gap, a, b)
            # the gap rises first: the root is beyond its maximum
            if speeds[i] <= 0 or speeds[i + 1] >= 0:
                return a
            top = brentq(speed, a, b, **_ROOT)
            return _root(gap, top, b)
        if speeds[i] < 0 < speeds[i + 1]:
            bottom = brentq(speed, a, b, **_ROOT)
            if gap(bottom) < 0:
                return _root(gap, a, bottom)
    return None


def _letting_go(dynamics, dense, times, held, k):
    """The first zero of the contact force at gap `k`."""
    place = list(held).index(k)

    def force(t):
        return dynamics.pressure(t, dense(t), held)[place]

    forces = np.array([force(t) for t in times])
    if np.min(forces[1:]) >= 0 and not _turns_low(forces):
        return None
    for i in range(len(times) - 1):
        a, b = times[max(i - 1, 0)], times[i + 1]
        if forces[i + 1] < 0:
            start = times[i]
            return _root(force, start, b)
        if _turns_low(forces[max(i - 1, 0) : i + 2]):
            lowest = minimize_scalar(
                force, (a, b), method="bounded", options={"xatol": 1e-9}
            )
            if lowest.fun < 0:
                return _root(force, a, lowest.x)
    return None


def _root(function, a, b):
    """The downward zero crossing of a function in [a, b], or an end if rounding places
    it there.

    Evaluating many points at once rounds differently, so the sign is checked again.
    """
    if function(a) <= 0:
        return a
    return brentq(function, a, b, **_ROOT) if function(b) < 0 else b


def _turns_low(values) -> bool:
    """Whether a minimum is so close to zero that it may be negative between grid
    points.
    """
    if len(values) < 3:
        return False
    before, middle, after = values[:-2], values[1:-1], values[2:]
    turn = (before > middle) & (middle < after)
    return bool(np.any(turn & (middle < np.maximum(before, after) - middle)))
