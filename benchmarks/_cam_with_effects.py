"""Simulate a cam-follower rig with any effect from `_hidden_effects.py`, in numba.

It shares no code with `jaxcam.hybrid`: Runge-Kutta steps between samples, and events
located by bisection.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numba
import numpy as np

from benchmarks._hidden_physics import Effect, Hidden
from benchmarks._numba_rig import _acceleration, _drive, _ROUNDING, _surface
from jaxcam.data.make_demo import RealRig


_KINDS = ("force", "resonance", "restitution", "surface")
_FORCE, _RESONANCE, _RESTITUTION, _SURFACE = range(len(_KINDS))
_NOTHING = Effect("", (), lambda u, w, phi, t, s: 0.0, (0.0, 0.0))
# Step of the differences that give the rates of a moving surface (s)
_SMALL = 1e-4


class _Rig(NamedTuple):
    """What a run depends on, apart from the functions of the effects.

    - `harmonics` of the contact angle; `numbers` as in `_numba_rig`.
    - `scales`: for each of `_KINDS`, a row `(middle, reach, velocity, duration, hertz,
        size)` for the arguments of the effect and its value; `remembers`: the place in
        `_KINDS` of the effect with states of its own.
    - `speed` of the drive (rad/s), and the time `clock` (s) at which the record begins.
    """

    harmonics: np.ndarray
    numbers: np.ndarray
    scales: np.ndarray
    remembers: int
    speed: float
    clock: float


def run(
    rig: RealRig,
    hidden: dict[str, Hidden],
    speed: float,
    duration: float,
    settle: float,
    interval: float = 5e-4,
):
    """The last `duration` (s) of a run at `speed` (rad/s), with effects by their kind.

    **Returns:** a row `(cam rotation, angle, velocity)` for each sample, and a row
    `(time, approach speed, cam rotation)` for each impact.
    """
    effects = tuple(hidden[k].effect if k in hidden else _NOTHING for k in _KINDS)
    numbers = np.zeros(21)
    numbers[:7] = (
        rig.stiffness_over_inertia,
        rig.spring_hook_x,
        rig.half_height,
        rig.spring_elongation,
        rig.restitution,
        rig.damping,
        rig.wander,
    )
    scales = np.ones((len(_KINDS), 6))
    for row, kind in zip(scales, _KINDS):
        if kind in hidden:
            s, unit = hidden[kind].scales, hidden[kind].unit
            row[:] = s.middle, s.reach, s.velocity, s.lasts, s.hertz, unit
    remembers = _RESONANCE if "resonance" in hidden else _FORCE
    clock = interval * round(settle / interval)
    whole = _Rig(rig.profile(), numbers, scales, remembers, speed, clock)
    count = round((settle + duration) / interval)
    rows, struck = _run(*_compiled(effects), whole, interval, count)
    impacts = np.array(struck).reshape(-1, 3)
    return rows[round(settle / interval) :], impacts[impacts[:, 0] >= 0]


@functools.cache
def _compiled(effects: tuple[Effect, ...]) -> tuple[Callable, Callable]:
    """The value of the effect of a given kind, and the rates of the states of all
    effects, two in total.
    """
    force, resonance, restitution, surface = (numba.njit(one.value) for one in effects)

    @numba.njit
    def value(kind, u, w, phi, t, s):
        if kind == _FORCE:
            return force(u, w, phi, t, s)
        if kind == _RESONANCE:
            return resonance(u, w, phi, t, s)
        if kind == _RESTITUTION:
            return restitution(u, w, phi, t, s)
        return surface(u, w, phi, t, s)

    remembering = [one for one in effects if one.memory is not None]
    if not remembering:
        return value, numba.njit(lambda own, u, rate, hertz: (0.0, 0.0))
    (effect,) = remembering
    assert effect.memory is not None
    memory = numba.njit(effect.memory)
    if effect.states == 1:
        alone = memory
        memory = numba.njit(
            lambda own, u, rate, hertz: (alone(own, u, rate, hertz)[0], 0.0)
        )
    return value, memory


@numba.njit
def _effect(value, kind, rig, t, x, v, s):
    middle, reach, velocity, duration, _, size = rig.scales[kind]
    share = min(max((t - rig.clock) / duration, 0.0), 1.0)
    angle = _drive(t, rig.speed, rig.numbers)[0]
    return size * value(kind, (x - middle) / reach, v / velocity, angle, share, s)


@numba.njit
def _ground(value, rig, t):
    """Angle, velocity and acceleration of a follower in contact."""
    x, v, a = _surface(t, rig.speed, rig.numbers, rig.harmonics)
    low = _effect(value, _SURFACE, rig, t - _SMALL, 0.0, 0.0, 0.0)
    here = _effect(value, _SURFACE, rig, t, 0.0, 0.0, 0.0)
    high = _effect(value, _SURFACE, rig, t + _SMALL, 0.0, 0.0, 0.0)
    x += here
    v += (high - low) / (2 * _SMALL)
    a += (high - 2 * here + low) / _SMALL**2
    return x, v, a


@numba.njit
def _free(value, rig, t, x, v, own):
    """Acceleration of a follower that is not in contact."""
    a = _acceleration(t, x, v, rig.speed, rig.numbers, rig.clock)
    a += _effect(value, _FORCE, rig, t, x, v, own[0])
    a += _effect(value, _RESONANCE, rig, t, x, v, own[0])
    return a


@numba.njit
def _rates(value, memory, rig, t, x, v, own):
    middle, reach, _, _, hertz, _ = rig.scales[rig.remembers]
    a = _free(value, rig, t, x, v, own)
    return a, *memory(own, (x - middle) / reach, v / reach, hertz)


@numba.njit
def _moved(x, v, own, h, speed, rates):
    a, b, c = rates
    return x + h * speed, v + h * a, (own[0] + h * b, own[1] + h * c)


@numba.njit
def _fly(value, memory, rig, t, x, v, own, h):
    """Angle, velocity and the effect's states after a Runge-Kutta step."""
    k1 = _rates(value, memory, rig, t, x, v, own)
    x2, v2, own2 = _moved(x, v, own, h / 2, v, k1)
    k2 = _rates(value, memory, rig, t + h / 2, x2, v2, own2)
    x3, v3, own3 = _moved(x, v, own, h / 2, v2, k2)
    k3 = _rates(value, memory, rig, t + h / 2, x3, v3, own3)
    x4, v4, own4 = _moved(x, v, own, h, v3, k3)
    k4 = _rates(value, memory, rig, t + h, x4, v4, own4)
    mean = (
        (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]) / 6,
        (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1]) / 6,
        (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2]) / 6,
    )
    return _moved(x, v, own, h, (v + 2 * v2 + 2 * v3 + v4) / 6, mean)


@numba.njit
def _happens(resting, value, memory, rig, t, x, v, own, h):
    """Whether a follower in contact is pulled off the cam after a time `h`, or one in
    flight is inside the cam.
    """
    ahead, _, states = _fly(value, memory, rig, t, x, v, own, h)
    place, rate, acceleration = _ground(value, rig, t + h)
    if resting:
        return _free(value, rig, t + h, place, rate, states) > acceleration
    return ahead < place - _ROUNDING


@numba.njit
def _first(resting, value, memory, rig, t, x, v, own, h):
    """The time up to `h` of an event that has happened at `h`."""
    low, high = 0.0, h
    for _ in range(45):
        middle = (low + high) / 2
        if _happens(resting, value, memory, rig, t, x, v, own, middle):
            high = middle
        else:
            low = middle
    return high


@numba.njit
def _run(value, memory, rig, interval, count):
    rows = np.empty((count, 3))
    struck = [(-1.0, 0.0, 0.0)]
    t, own, resting, longest = 0.0, (0.0, 0.0), False, interval
    x, v, _ = _ground(value, rig, t)
    x += 0.01
    for sample in range(count):
        target = sample * interval
        while t < target:
            h = min(target - t, longest)
            happens = _happens(resting, value, memory, rig, t, x, v, own, h)
            if happens:
                h = _first(resting, value, memory, rig, t, x, v, own, h)
            x, v, own = _fly(value, memory, rig, t, x, v, own, h)
            t = target if h == target - t else t + h
            if not (resting or happens):
                longest = interval
                continue
            place, rate, acceleration = _ground(value, rig, t)
            x, approach = place, rate - v
            v = rate
            if resting:
                resting = not happens
                continue
            struck.append(
                (t - rig.clock, approach, _drive(t, rig.speed, rig.numbers)[0])
            )
            r = rig.numbers[4]
            s = abs(approach) / rig.scales[_RESTITUTION, 2]
            r *= math.exp(_effect(value, _RESTITUTION, rig, t, x, v, s))
            v = rate + r * approach
            pull = acceleration - _free(value, rig, t, x, v, own)
            flight = 2 * r * approach / pull if pull > 0 else interval
            resting = 0 < flight < 1e-6 * (1 - r)
            longest = interval if resting else min(interval, max(flight / 2, 1e-8))
            if resting:
                v = rate
        rows[sample, 0] = _drive(target, rig.speed, rig.numbers)[0]
        rows[sample, 1] = x
        rows[sample, 2] = v
    return rows, struck
