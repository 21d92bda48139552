"""Records of a pendulum beside a wall, by scipy, with a sensor that may be wrong.

Shares no code with the package: `docs/rigs/pendulum_wall` is its textbook model.
"""

import functools

import numpy as np
from scipy.integrate import solve_ivp

from jaxcam.recordings import Recording


GRAVITY, DAMPING, SHAKE, WALL, BOUNCE = 39.0, 0.035, 0.101, -0.1505, 0.68
NOISE, COUNT, DRIVE_NOISE = 1.2e-4, 2 * np.pi / 40000, 1e-4
# slow enough that nothing is pressed against the wall
SPEEDS = (5.2, 6.0, 6.8, 7.4)
INTERVAL = 5e-4


@functools.cache
def motion(speed: float, lasting: float, settle: float = 12.0):
    """Time, angle of the drive, position and velocity, once the beginning is over."""

    def field(t, x):
        base = -SHAKE * speed**2 * np.sin(speed * t)
        pull = -GRAVITY * np.sin(x[0]) - base * np.cos(x[0])
        return [x[1], pull - DAMPING * x[1]]

    def wall(t, x):
        return x[0] - WALL

    wall.terminal, wall.direction = True, -1.0  # pyright: ignore
    time = settle + INTERVAL * np.arange(round(lasting / INTERVAL))
    rows = np.zeros((len(time), 2))
    t, x = 0.0, [0.3, 0.0]
    while t < time[-1]:
        found = solve_ivp(
            field, (t, time[-1] + INTERVAL), x,
            events=wall, rtol=1e-9, atol=1e-11, dense_output=True,
        )  # fmt: skip
        end = found.t[-1]
        inside = (time >= t) & (time <= end)
        if np.any(inside):
            rows[inside] = found.sol(time[inside]).T
        t, x = end, [WALL, -BOUNCE * found.y[1, -1]]
        if found.status == 0:
            break
    return time - settle, speed * time, rows[:, 0], rows[:, 1]


def records(error, lasting: float = 4.0, seed: int = 0) -> list[Recording]:
    """Four records; `error(time, turned, position)` is what the sensor adds."""
    rng = np.random.default_rng(seed)
    runs = []
    for number, speed in enumerate(SPEEDS):
        time, turned, position, _ = motion(speed, lasting)
        shown = position + error(time, turned, position)
        shown = shown + NOISE * rng.standard_normal(len(time))
        first = 2 * np.pi * np.floor(turned[0] / (2 * np.pi))
        drive = turned - first + DRIVE_NOISE * rng.standard_normal(len(time))
        channels = {
            "drive_angle_rad": drive,
            "angle_rad": np.round(shown / COUNT) * COUNT,
        }
        runs.append(Recording(f"run{number + 1}", time, channels))
    return runs
