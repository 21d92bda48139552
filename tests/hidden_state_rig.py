"""Records of a cart between two stops with a hidden state, by scipy alone.

The truth of tests: flights by DOP853, from impact to impact. Nothing of the package
integrates them.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from jaxcam.recordings import Recording


LEFT, RIGHT, R_LEFT, R_RIGHT = -0.0502, 0.0797, 0.72, 0.63
STIFFNESS, DAMPING, AMPLITUDE = 60.4, 0.14, 0.0202
NOISE, STEP = 1e-5, 5e-6
DRIVE_NOISE = 1e-4


@dataclasses.dataclass(frozen=True)
class Hidden:
    """A hidden state: its rate and its force, functions of x, v and the state.

    `begin(phase)` is its state at time zero, where nothing moves it.
    """

    size: int
    rate: Callable
    force: Callable
    begin: Callable | None = None


def nothing() -> Hidden:
    return Hidden(0, lambda x, v, z: [], lambda x, v, z: 0.0)


def resonance(mass: float, frequency: float, damping: float) -> Hidden:
    """A mass on a spring that the cart carries: it moves against the cart."""
    w = 2 * math.pi * frequency

    def rate(x, v, z):
        # absolute motion of the carried mass, which is driven by the cart's
        return [z[1], -(w**2) * (z[0] - x) - 2 * damping * w * (z[1] - v)]

    def force(x, v, z):
        return mass * (w**2 * (z[0] - x) + 2 * damping * w * (z[1] - v))

    return Hidden(2, rate, force)


def relaxation(stiffness: float, time: float) -> Hidden:
    """A spring and a dashpot in a row (Maxwell)."""
    return Hidden(
        1, lambda x, v, z: [v - z[0] / time], lambda x, v, z: -stiffness * z[0]
    )


def hysteresis(stiffness: float, limit: float) -> Hidden:
    """Bouc and Wen with n = 1 and elastic unloading."""

    def rate(x, v, z):
        return [v - 0.5 * (abs(v) * z[0] + v * abs(z[0])) / limit]

    return Hidden(1, rate, lambda x, v, z: -stiffness * z[0])


def shaken(amplitude: float, frequency: float) -> Hidden:
    """A force of time, as of a foundation that shakes: nothing moves it."""
    w = 2 * math.pi * frequency
    return Hidden(
        2,
        lambda x, v, z: [z[1], -(w**2) * z[0]],
        lambda x, v, z: amplitude * z[0],
        lambda phase: [math.cos(phase), -w * math.sin(phase)],
    )


def motion(hidden: Hidden, speed: float, duration: float, interval: float, start=()):
    """Positions of the cart at equal times from zero, after it has settled or, with
    the `start` of a hidden state, from a state of its own."""
    settle = 0.0 if len(start) else 6.0
    times = np.arange(0.0, duration, interval)
    found = np.zeros(len(times))

    def field(t, y):
        x, v, z = y[0], y[1], y[2:]
        base = -AMPLITUDE * speed**2 * math.sin(speed * t)
        push = -STIFFNESS * x - DAMPING * v - base + hidden.force(x, v, z)
        return [v, push, *hidden.rate(x, v, z)]

    def left(t, y):
        return y[0] - LEFT

    def right(t, y):
        return RIGHT - y[0]

    for event in (left, right):
        event.terminal, event.direction = True, -1  # pyright: ignore
    t, y = -settle, np.array([0.01, 0.3, *([0.0] * hidden.size)])
    if hidden.size and len(start):
        y[2:] = start
    while t < times[-1]:
        flight = solve_ivp(
            field,
            (t, times[-1] + interval),
            y,
            "DOP853",
            None,
            True,
            (left, right),
            rtol=1e-9,
            atol=1e-11,
        )
        end = flight.t[-1]
        inside = (times >= max(t, 0.0)) & (times <= end)
        if inside.any():
            found[inside] = flight.sol(times[inside])[0]
        t, y = end, flight.y[:, -1].copy()
        if flight.status == 1:
            y[1] *= -(R_LEFT if len(flight.t_events[0]) else R_RIGHT)
    return times, found


def records(
    hidden: Hidden,
    seed: int,
    duration: float = 5.0,
    interval: float = 1e-3,
    frequencies=(1.36, 1.62, 1.95, 2.3),
) -> list[Recording]:
    """Four records of noisy encoders, at four speeds of the drive."""
    rng = np.random.default_rng(seed)
    runs = []
    for number, frequency in enumerate(frequencies, start=1):
        speed = 2 * math.pi * frequency * (1 + 0.02 * rng.standard_normal())
        phase = rng.uniform(0, 2 * math.pi)
        start = () if hidden.begin is None else hidden.begin(phase)
        times, x = motion(hidden, speed, duration, interval, start)
        seen = x + NOISE * rng.standard_normal(len(x))
        turned = speed * times + DRIVE_NOISE * rng.standard_normal(len(x))
        channels = {
            "drive_angle_rad": turned,
            "position_m": STEP * np.round(seen / STEP),
        }
        runs.append(Recording(f"run{number}_{frequency:.2f}Hz", times, channels))
    return runs
