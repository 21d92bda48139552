"""Free runs of any oscillator model with a held input, with or without a stop."""

import math
from collections.abc import Callable, Sequence

import numpy as np


# Number of steps between two samples, and of samples from which a free run starts
_STEPS, START = 2, 20
# Gauss-Newton steps for the initial state, and relative size of finite differences
_NEWTON, _APART = 8, 1e-4
# A run this many times larger than its measurement has diverged
_LARGE = 30.0

Field = Callable[[Sequence[float], float], Sequence[float]]


def run_freely(
    field: Field,
    rate: float,
    u: np.ndarray,
    measured: np.ndarray,
    *,
    own: int = 0,
    stop: float = math.inf,
    restitution: float = 0.0,
) -> np.ndarray:
    """Positions predicted from the first samples and the input; infinite if the run
    diverges.

    `field(state, u)` is the rate of change of position, velocity and `own` further
    states, which start from zero.
    """
    limit = _LARGE * float(np.max(np.abs(measured)))
    first, step = u[:START], 1 / rate
    state = [float(measured[0]), 0.0]
    scale = np.array([np.ptp(measured), np.ptp(measured) * rate / 10])
    rest = [0.0] * own

    def run(start, levels):
        return _positions(
            field, step, [*start, *rest], levels, stop, restitution, limit
        )

    for _ in range(_NEWTON):
        found = run(state, first)
        apart = _APART * scale
        beside = [run(np.add(state, apart * unit), first) for unit in np.eye(2)]
        slopes = np.stack([(one - found) / _APART for one in beside], axis=1)
        off = measured[:START] - found
        if not (np.all(np.isfinite(slopes)) and np.all(np.isfinite(off))):
            break
        change = np.linalg.lstsq(slopes, off, rcond=None)[0] * scale
        state = np.add(state, change).tolist()
        if np.all(np.abs(change) < 1e-9 * scale):
            break
    return run(state, u)


def _positions(field, step, state, levels, stop, restitution, limit) -> np.ndarray:
    found = np.full(len(levels), math.inf)
    for k, level in enumerate(levels):
        if not abs(state[0]) < limit:
            break
        found[k] = state[0]
        for _ in range(_STEPS):
            state = _advanced(
                field, step / _STEPS, state, float(level), stop, restitution
            )
    return found


def _advanced(field, h, state, u, stop, restitution):
    """A Runge-Kutta step, with an impact if the stop is reached."""
    after = _step(field, h, state, u)
    if not after[0] > stop:
        return after
    low, high = 0.0, h
    for _ in range(40):
        middle = (low + high) / 2
        if _step(field, middle, state, u)[0] > stop:
            high = middle
        else:
            low = middle
    met = _step(field, low, state, u)
    met = [min(met[0], stop), -restitution * abs(met[1]), *met[2:]]
    after = _step(field, h - low, met, u)
    # a mass that is pressed against the stop stays there
    return after if after[0] <= stop else [stop, min(after[1], 0.0), *after[2:]]


def _step(field, h, x, u):
    if len(x) == 2:
        return _step_of_two(field, h, x, u)
    a = field(x, u)
    b = field([p + h / 2 * q for p, q in zip(x, a)], u)
    c = field([p + h / 2 * q for p, q in zip(x, b)], u)
    d = field([p + h * q for p, q in zip(x, c)], u)
    return [p + h / 6 * (i + 2 * j + 2 * k + m) for p, i, j, k, m in zip(x, a, b, c, d)]


def _step_of_two(field, h, x, u):
    """The same step for two states, several times as fast."""
    p, v = x
    v1, a1 = field(x, u)
    v2, a2 = field((p + h / 2 * v1, v + h / 2 * a1), u)
    v3, a3 = field((p + h / 2 * v2, v + h / 2 * a2), u)
    v4, a4 = field((p + h * v3, v + h * a3), u)
    return [
        p + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4),
        v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4),
    ]


def error_of(found: np.ndarray, true: np.ndarray) -> float:
    """RMS error of a free run after its start, in units of the rms of the signal."""
    if not np.all(np.isfinite(found)):
        return math.inf
    return float(np.sqrt(np.mean((found - true)[START:] ** 2) / np.mean(true**2)))


def force_error(found: np.ndarray, true: np.ndarray, extra: np.ndarray) -> float:
    """RMS error of an acceleration, divided by the rms of the extra force."""
    return float(np.sqrt(np.mean((found - true) ** 2) / np.mean(extra**2)))
