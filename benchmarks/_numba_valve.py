"""A scalar loop for the relief valve: Cash-Karp steps of order 5, events by secants.

It does what published codes do with this system: it uses an adaptive embedded method,
and locates the points on the section, where the lift rate falls through zero, and the
impacts, at zero lift, by repeating the step with other lengths.
"""

import numba
import numpy as np


_A = np.array(
    [
        [0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0],
        [3 / 10, -9 / 10, 6 / 5, 0, 0],
        [-11 / 54, 5 / 2, -70 / 27, 35 / 27, 0],
        [1631 / 55296, 175 / 512, 575 / 13824, 44275 / 110592, 253 / 4096],
    ]
)
_B = np.array([37 / 378, 0, 250 / 621, 125 / 594, 0, 512 / 1771])
_LOW = np.array([2825 / 27648, 0, 18575 / 48384, 13525 / 55296, 277 / 14336, 1 / 4])
# damping, preload, compressibility and coefficient of restitution
_DAMPING, _PRELOAD, _STIFF, _RESTITUTION = 1.25, 10.0, 20.0, 0.8


@numba.njit(fastmath=False, inline="always")
def _rates(x, v, p, flow):
    pressure = p - _PRELOAD - x - _DAMPING * v
    return v, pressure, _STIFF * (flow - x * np.sqrt(max(p, 0.0)))


@numba.njit
def _step(state, flow, h, stages, after):
    """Fill `after`; return the error relative to that allowed, 1e-10."""
    for i in range(6):
        x, v, p = state[0], state[1], state[2]
        for j in range(i):
            a = h * _A[i, j]
            x += a * stages[j, 0]
            v += a * stages[j, 1]
            p += a * stages[j, 2]
        stages[i, 0], stages[i, 1], stages[i, 2] = _rates(x, v, p, flow)
    worst = 0.0
    for k in range(3):
        total, error = 0.0, 0.0
        for i in range(6):
            total += _B[i] * stages[i, k]
            error += (_B[i] - _LOW[i]) * stages[i, k]
        after[k] = state[k] + h * total
        scale = max(abs(state[k]), abs(after[k]))
        worst = max(worst, abs(h * error) / (1e-10 + 1e-10 * scale))
    return worst


@numba.njit
def _one(flow, duration, keep):
    """Return the last `keep` lifts on the section, and the number of returns."""
    state, after = np.array([0.2, 0.0, 10.0]), np.zeros(3)
    stages, found = np.zeros((6, 3)), np.zeros(keep)
    h, points, t = 1e-3, 0, 0.0
    while t < duration:
        h = min(h, duration - t)
        error = _step(state, flow, h, stages, after)
        if error > 1.0:
            h *= max(0.2, 0.9 * error**-0.25)
            continue
        grown = h * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
        hits = state[0] > 0.0 and after[0] < 0.0
        turns = state[1] > 1e-12 and after[1] < 0.0
        if hits or turns:
            k = 0 if hits else 1
            # regula falsi with halved weights (Illinois)
            low, high, left, right, middle = 0.0, h, state[k], after[k], h
            for _ in range(60):
                middle = low + (high - low) * left / (left - right)
                _step(state, flow, middle, stages, after)
                if abs(after[k]) < 1e-12:
                    break
                if (after[k] > 0) == (left > 0):
                    low, left = middle, after[k]
                    right *= 0.5
                else:
                    high, right = middle, after[k]
                    left *= 0.5
            if hits and state[1] > 1e-12 and after[1] < 0.0:
                # the section lies before the impact in the same step
                h *= 0.5
                continue
            if hits:
                after[0] = 0.0
                after[1] *= -_RESTITUTION
            else:
                after[1] = 0.0
                found[points % keep] = after[0]
                points += 1
            t += middle
        else:
            t += h
        state[:] = after
        h = grown
    return found[(np.arange(keep) + points) % keep], points


@numba.njit
def simulate(flows, duration, keep):
    """Return the last lifts on the section, `(flows, keep)`, and the returns."""
    lifts, returns = np.zeros((len(flows), keep)), np.zeros(len(flows))
    for i in range(len(flows)):
        lifts[i], returns[i] = _one(flows[i], duration, keep)
    return lifts, returns
