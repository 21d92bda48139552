"""Simulate a cam-follower rig with effects that a model may lack, in numba.

It shares no code with `jaxcam.hybrid`. It takes Runge-Kutta steps between samples and
locates impacts by bisection; in contact, the follower stays on the surface until its
free acceleration lifts it off.
"""

import dataclasses
import math

import numba
import numpy as np

from jaxcam.data.make_demo import RealRig


# A gap that opens from zero is not considered closed again below this value (rad)
_ROUNDING = 1e-13


@dataclasses.dataclass(frozen=True)
class Hidden:
    """Effects in addition to the textbook physics; units as in `jaxcam.discrepancy`.

    The last four are not in the list of named effects: `imbalance` (rad/s^2), the
    weight of the arm; `fading` (1/s), a coefficient of restitution that falls with
    time; `step` (rad/s^2), a force during half of each turn; `one_way` (rad/s^2),
    friction during upward motion only.
    """

    c1: float = 0.0
    fc: float = 0.0
    c2: float = 0.0
    k3: float = 0.0
    rb: float = 0.0
    run: float = 0.0
    eps: float = 0.0
    psi: float = 1.0
    lag: float = 0.0
    ext: float = 0.0
    fe: float = 30.0
    imbalance: float = 0.0
    fading: float = 0.0
    step: float = 0.0
    one_way: float = 0.0


@dataclasses.dataclass(frozen=True)
class Samples:
    """True samples: time (s), cam rotation and follower angle (rad)."""

    time: np.ndarray
    turned: np.ndarray
    angle: np.ndarray


def simulate(
    rig: RealRig,
    hidden: Hidden,
    speed: float,
    duration: float,
    settle: float,
    interval: float = 5e-4,
) -> Samples:
    """Run the rig at `speed` (rad/s) and keep the last `duration` (s)."""
    harmonics = rig.profile()
    if hidden.run:
        harmonics = harmonics.copy()
        harmonics[2] += hidden.run * np.exp(0.7j)
    numbers = np.array(
        [
            rig.stiffness_over_inertia,
            rig.spring_hook_x,
            rig.half_height,
            rig.spring_elongation,
            rig.restitution,
            rig.damping + hidden.c1,
            rig.wander,
            *dataclasses.astuple(hidden)[1:],
        ]
    )
    count, first = round((settle + duration) / interval), round(settle / interval)
    turned, angle = _run(harmonics, numbers, speed, interval, count, first)
    return Samples(interval * np.arange(count - first), turned[first:], angle[first:])


@numba.njit(cache=True)
def _drive(t, speed, n):
    wander, eps, psi = n[6], n[12], n[13]
    angle, rate, change = speed * t, speed, 0.0
    for share, frequency in ((0.7, 0.31), (0.3, 0.87)):
        w, a = 2 * math.pi * frequency, wander * speed * share
        angle += a / w * math.sin(w * t)
        rate += a * math.cos(w * t)
        change -= a * w * math.sin(w * t)
    s, c = math.sin(angle - psi), math.cos(angle - psi)
    return (
        angle + eps * s,
        rate * (1 + eps * c),
        change * (1 + eps * c) - eps * rate * rate * s,
    )


@numba.njit(cache=True)
def _surface(t, speed, n, harmonics):
    angle, rate, change = _drive(t, speed, n)
    value, slope, bend = harmonics[0].real, 0.0, 0.0
    turn = complex(math.cos(angle), math.sin(angle))
    wave = turn
    for k in range(1, len(harmonics)):
        part = harmonics[k] * wave
        value += part.real
        slope -= k * part.imag
        bend -= k * k * part.real
        wave *= turn
    return value, slope * rate, bend * rate**2 + slope * change


@numba.njit(cache=True)
def _sign(v):
    return (v > 0.0) - (v < 0.0)


@numba.njit(cache=True)
def _acceleration(t, x, v, speed, n, clock):
    sine, secant = math.sin(x), 1 / math.cos(x)
    stretch = (n[1] * sine + n[2]) * secant
    arm = (n[1] + n[2] * sine) * secant**2
    a = -n[0] * (stretch - n[3]) * arm
    a -= n[5] * v + n[7] * _sign(v) + n[8] * abs(v) * v + n[9] * (x - 0.27) ** 3
    a += n[15] * math.sin(2 * math.pi * n[16] * (t - clock) + 0.5)
    a -= n[17] * math.cos(x)
    if n[19] != 0.0:
        angle = _drive(t, speed, n)[0]
        a += n[19] * (math.sin(angle - 1.0) > 0.0)
    return a - n[20] * (v > 0.0)


@numba.njit(cache=True)
def _fly(t, x, v, h, speed, n, clock):
    a1 = _acceleration(t, x, v, speed, n, clock)
    v2 = v + h / 2 * a1
    a2 = _acceleration(t + h / 2, x + h / 2 * v, v2, speed, n, clock)
    v3 = v + h / 2 * a2
    a3 = _acceleration(t + h / 2, x + h / 2 * v2, v3, speed, n, clock)
    v4 = v + h * a3
    a4 = _acceleration(t + h, x + h * v3, v4, speed, n, clock)
    return x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (
        a1 + 2 * a2 + 2 * a3 + a4
    )


@numba.njit(cache=True)
def _lifts(t, speed, n, harmonics, clock):
    x, v, a = _surface(t, speed, n, harmonics)
    return _acceleration(t, x, v, speed, n, clock) > a


@numba.njit(cache=True)
def _run(harmonics, n, speed, interval, count, first):
    lag, clock = n[14], first * interval
    turned, angle = np.empty(count), np.empty(count)
    t = 0.0
    x, v, _ = _surface(t, speed, n, harmonics)
    x += 0.01
    resting, longest = False, interval
    for sample in range(count):
        # a delayed sensor shows an earlier value
        target = sample * interval - lag
        while t < target:
            h = min(target - t, longest)
            if resting:
                if _lifts(t + h, speed, n, harmonics, clock):
                    low, high = 0.0, h
                    for _ in range(45):
                        middle = (low + high) / 2
                        if _lifts(t + middle, speed, n, harmonics, clock):
                            high = middle
                        else:
                            low = middle
                    t += high
                    resting = False
                else:
                    t = target if h == target - t else t + h
                x, v, _ = _surface(t, speed, n, harmonics)
                continue
            ahead, later = _fly(t, x, v, h, speed, n, clock)
            if ahead >= _surface(t + h, speed, n, harmonics)[0] - _ROUNDING:
                x, v, longest = ahead, later, interval
                t = target if h == target - t else t + h
                continue
            low, high = 0.0, h
            for _ in range(45):
                middle = (low + high) / 2
                there = _fly(t, x, v, middle, speed, n, clock)[0]
                ground = _surface(t + middle, speed, n, harmonics)[0]
                if there < ground - _ROUNDING:
                    high = middle
                else:
                    low = middle
            v = _fly(t, x, v, high, speed, n, clock)[1]
            t += high
            x, rate, acceleration = _surface(t, speed, n, harmonics)
            approach = rate - v
            r = n[4] * (1 + max(approach, 0.0) / 0.3) ** -n[10]
            r *= 1 - n[18] * (t - clock)
            v = rate + r * approach
            pull = acceleration - _acceleration(t, x, v, speed, n, clock)
            flight = 2 * r * approach / pull if pull > 0 else interval
            if 0 < flight < 1e-6 * (1 - r):
                resting, v, longest = True, rate, interval
                continue
            longest = min(interval, max(flight / 2, 1e-8))
        turned[sample] = _drive(sample * interval, speed, n)[0]
        angle[sample] = x
    return turned, angle
