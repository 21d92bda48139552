"""Lyapunov exponents of the forced oscillator in numba, one batch element at a time.

It uses the Dormand-Prince 5(4) pair, with step control on the state and its two
deviations together; it locates impacts by Newton's method on the step length, and
applies the saltation matrix and Gram-Schmidt at every impact.
"""

import math

import numpy as np
from numba import njit


_OPTIONS = {"cache": True, "fastmath": False, "error_model": "numpy"}


@njit(inline="always", **_OPTIONS)
def _rates(t, y, omega, damping, out):
    out[0] = y[1]
    out[1] = math.cos(omega * t) - y[0] - 2 * damping * y[1]
    out[2] = y[3]
    out[3] = -y[2] - 2 * damping * y[3]
    out[4] = y[5]
    out[5] = -y[4] - 2 * damping * y[5]


@njit(**_OPTIONS)
def _step(t, y, h, omega, damping, k, z, after):
    """One step; `k[0]` holds the rates at its start, `k[6]` those at its end."""
    for i in range(6):
        z[i] = y[i] + h * 0.2 * k[0, i]
    _rates(t + 0.2 * h, z, omega, damping, k[1])
    for i in range(6):
        z[i] = y[i] + h * (3 / 40 * k[0, i] + 9 / 40 * k[1, i])
    _rates(t + 0.3 * h, z, omega, damping, k[2])
    for i in range(6):
        z[i] = y[i] + h * (44 / 45 * k[0, i] - 56 / 15 * k[1, i] + 32 / 9 * k[2, i])
    _rates(t + 0.8 * h, z, omega, damping, k[3])
    for i in range(6):
        z[i] = y[i] + h * (
            19372 / 6561 * k[0, i]
            - 25360 / 2187 * k[1, i]
            + 64448 / 6561 * k[2, i]
            - 212 / 729 * k[3, i]
        )
    _rates(t + 8 / 9 * h, z, omega, damping, k[4])
    for i in range(6):
        z[i] = y[i] + h * (
            9017 / 3168 * k[0, i]
            - 355 / 33 * k[1, i]
            + 46732 / 5247 * k[2, i]
            + 49 / 176 * k[3, i]
            - 5103 / 18656 * k[4, i]
        )
    _rates(t + h, z, omega, damping, k[5])
    for i in range(6):
        after[i] = y[i] + h * (
            35 / 384 * k[0, i]
            + 500 / 1113 * k[2, i]
            + 125 / 192 * k[3, i]
            - 2187 / 6784 * k[4, i]
            + 11 / 84 * k[5, i]
        )
    _rates(t + h, after, omega, damping, k[6])


@njit(**_OPTIONS)
def _effort(y, after, h, k, tolerance):
    worst = 0.0
    for i in range(6):
        error = h * (
            71 / 57600 * k[0, i]
            - 71 / 16695 * k[2, i]
            + 71 / 1920 * k[3, i]
            - 17253 / 339200 * k[4, i]
            + 22 / 525 * k[5, i]
            - 1 / 40 * k[6, i]
        )
        size = tolerance * (1 + max(abs(y[i]), abs(after[i])))
        worst = max(worst, abs(error) / size)
    return worst


@njit(**_OPTIONS)
def _orthonormal(y, logs):
    length = math.hypot(y[2], y[3])
    logs[0] += math.log(length)
    y[2] /= length
    y[3] /= length
    dot = y[2] * y[4] + y[3] * y[5]
    y[4] -= dot * y[2]
    y[5] -= dot * y[3]
    length = math.hypot(y[4], y[5])
    logs[1] += math.log(length)
    y[4] /= length
    y[5] /= length


@njit(**_OPTIONS)
def _lane(omega, r, wall, damping, x, v, end, tolerance, logs):
    """Number of impacts up to time `end`; the sums of logarithms go to `logs`."""
    y = np.array([x, v, 1.0, 0.0, 0.0, 1.0])
    z, after = np.empty(6), np.empty(6)
    k = np.empty((7, 6))
    t, h, hits = 0.0, 0.01, 0
    logs[:] = 0.0
    _rates(t, y, omega, damping, k[0])
    while t < end:
        h = min(h, end - t)
        _step(t, y, h, omega, damping, k, z, after)
        effort = _effort(y, after, h, k, tolerance)
        factor = min(5.0, max(0.2, 0.9 * max(effort, 1e-10) ** -0.2))
        if effort > 1:
            h *= factor
            continue
        if after[0] > wall:
            # Newton's method on the step length, starting from the secant
            s = h * (wall - y[0]) / (after[0] - y[0])
            s = min(max(s, 0.0), h)
            for _ in range(20):
                _step(t, y, s, omega, damping, k, z, after)
                miss = wall - after[0]
                if abs(miss) < 1e-14:
                    break
                s = min(max(s + miss / after[1], 0.0), h)
            t += s
            speed = after[1]
            fall = math.cos(omega * t) - wall - 2 * damping * speed
            rise = math.cos(omega * t) - wall + 2 * damping * r * speed
            grown = (rise + r * fall) / speed
            for c in (2, 4):
                moved = after[c]
                after[c + 1] = grown * moved - r * after[c + 1]
                after[c] = -r * moved
            after[0], after[1] = wall, -r * speed
            y[:] = after
            _orthonormal(y, logs)
            hits += 1
            _rates(t, y, omega, damping, k[0])
            continue
        t += h
        y[:] = after
        k[0] = k[6]
        h *= factor
    _orthonormal(y, logs)
    return hits


@njit(**_OPTIONS)
def _lanes(omega, r, wall, damping, x, v, ends, tolerance, logs, hits):
    for i in range(omega.size):
        hits[i] = _lane(omega[i], r, wall, damping, x, v, ends[i], tolerance, logs[i])


def spectra(omega, r, wall, damping, start, turns: int, tolerance: float = 1e-9):
    """Exponents (lanes, 2) over `turns` periods of each frequency, and impacts."""
    logs, hits = np.empty((len(omega), 2)), np.empty(len(omega), dtype=np.int64)
    ends = turns * 2 * np.pi / omega
    x, v = start
    _lanes(omega, r, wall, damping, x, v, ends, tolerance, logs, hits)
    return logs / ends[:, None], hits
