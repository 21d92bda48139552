"""Recordings of the rigs in `docs/rigs`, by a simulator that shares nothing with ours.

Each rig is written down again as plain functions of numbers, and flown by scipy's
DOP853 from impact to impact.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from jaxcam.recordings import Recording


INTERVAL, SETTLE = 5e-4, 8.0
_COUNT = 2 * math.pi / 20000  # of the encoder on the drive
_DRIVE_NOISE = 1e-4
# A rig whose impacts come closer together than this (s) is drawn again
_CHATTER = 2e-3


class Maker(NamedTuple):
    """How a rig moves.

    - `field(p, x, phi, w, u)`: rate of change of the state, of the drive's angle and
        rate, or an input.
    - `gaps(p, x)`, and `impacts`, one law `(p, x)` for each of them.
    - `start`: of the state; `speeds` (rad/s): least and largest, of a driven rig.
    - `channels`: name of each and the component of the state it shows.
    """

    field: Callable
    gaps: Callable
    impacts: tuple[Callable, ...]
    start: tuple[float, ...]
    channels: dict[str, int]
    speeds: tuple[float, float] | None = None


class Accumulates(Exception):
    """Impacts come ever closer together: not what these rigs are tested with."""


def _two_stops(p, x, phi, w, u):
    base = -p["base_amplitude"] * w * w * math.sin(phi)
    pull = p["stiffness_over_mass"] * x[0] + p["damping_over_mass"] * x[1]
    return x[1], -pull - base


def _pendulum(p, x, phi, w, u):
    base = -p["base_amplitude_over_length"] * w * w * math.sin(phi)
    weight = p["gravity_over_length"] * math.sin(x[0])
    return x[1], -weight - p["damping"] * x[1] - base * math.cos(x[0])


def _two_masses(p, x, phi, w, u):
    shaken = p["shaker_amplitude"] * math.sin(phi)
    a1 = -p["k1_over_m1"] * (x[0] - p["rest1"]) - p["c1_over_m1"] * x[1]
    a2 = -p["k2_over_m2"] * (x[2] - p["rest2"] - shaken) - p["c2_over_m2"] * x[3]
    return x[1], a1, x[3], a2


def _stage(p, x, phi, w, u):
    return x[1], p["gain"] * u - p["damping"] * x[1]


def _reflected(name: str, place: int = 1):
    def law(p, x):
        after = np.array(x)
        after[place] *= -p[name]
        return after

    return law


def _collided(p, x):
    """Newton's law between two bodies of masses 1 and 0.7."""
    m, e = 0.7, p["restitution_masses"]
    w1 = (x[1] + m * x[3] - m * e * (x[1] - x[3])) / (1 + m)
    return np.array([x[0], w1, x[2], w1 + e * (x[1] - x[3])])


MAKERS = {
    "two_stops": Maker(
        _two_stops,
        lambda p, x: (x[0] - p["left"], p["right"] - x[0]),
        (_reflected("restitution_left"), _reflected("restitution_right")),
        (0.01, 0.3),
        {"position_m": 0},
        (8.0, 17.0),
    ),
    "pendulum_wall": Maker(
        _pendulum,
        lambda p, x: (x[0] - p["wall"],),
        (_reflected("restitution"),),
        (0.2, 0.5),
        {"angle_rad": 0},
        (6.5, 18.0),
    ),
    "two_masses": Maker(
        _two_masses,
        lambda p, x: (x[0], x[2] - x[0]),
        (_reflected("restitution_wall"), _collided),
        (0.004, 0.0, 0.012, 0.1),
        {"position1_m": 0, "position2_m": 2},
        (40.0, 62.0),
    ),
    "stage": Maker(_stage, lambda p, x: (), (), (0.0, 0.0), {"position_m": 0}),
}


def record_case(
    name: str, setup, truth: dict[str, float], rng, *, duration=6.0, records=4
) -> list[Recording]:
    """Recordings of one rig at several speeds, or with several inputs.

    **Raises:** `Accumulates` for a rig that comes to rest on a constraint.
    """
    maker, found = MAKERS[name], []
    for k in range(records):
        if maker.speeds is None:
            found.append(_with_input(maker, setup, truth, rng, duration, k))
            continue
        low, high = np.linspace(*maker.speeds, records + 1)[k : k + 2]
        speed = float(rng.uniform(low, high))
        found.append(_driven(maker, setup, truth, rng, duration, speed, k))
    return found


def _driven(maker, setup, truth, rng, duration, speed, number) -> Recording:
    shift = rng.uniform(0, 2 * math.pi, 3)

    def drive(t):
        """Angle and rate of a drive that wanders by 0.02 %."""
        angle, rate = speed * t + shift[0], speed
        for share, hertz, lead in ((0.7, 0.29, shift[1]), (0.3, 0.83, shift[2])):
            v = 2 * math.pi * hertz
            angle += speed * 2e-4 * share * math.sin(v * t + lead) / v
            rate += speed * 2e-4 * share * math.cos(v * t + lead)
        return angle, rate

    def field(t, x):
        return maker.field(truth, x, *drive(t), 0.0)

    time = INTERVAL * np.arange(round(duration / INTERVAL))
    states = _flown(maker, truth, field, np.array(maker.start), SETTLE, time)
    angle = np.array([drive(SETTLE + t)[0] for t in time])
    angle -= 2 * math.pi * math.floor(angle[0] / (2 * math.pi))
    noisy = angle + _DRIVE_NOISE * rng.standard_normal(len(time))
    channels = {setup.drive_channel: np.round(noisy / _COUNT) * _COUNT}
    channels |= _measured(maker, setup, states, rng)
    hertz = speed / (2 * math.pi)
    return Recording(f"run{number + 1}_{hertz:.3f}Hz", time, channels)


def _with_input(maker, setup, truth, rng, duration, number) -> Recording:
    """A smooth random voltage, held between samples; exact from sample to sample."""
    time = INTERVAL * np.arange(round(duration / INTERVAL))
    voltage = np.zeros(len(time))
    for hertz in rng.uniform(0.2, 3.0, 4):
        voltage += rng.uniform(0.3, 0.8) * np.sin(
            2 * math.pi * hertz * time + rng.uniform(0, 2 * math.pi)
        )
    voltage = np.round(np.clip(voltage, -1.5, 1.5), 3)
    c, gain = truth["damping"], truth["gain"]
    decay = math.exp(-c * INTERVAL)
    states = np.zeros((len(time), 2))
    for k in range(len(time) - 1):
        x, v = states[k]
        level = gain * voltage[k] / c
        states[k + 1] = (
            x + level * INTERVAL + (v - level) * (1 - decay) / c,
            level + (v - level) * decay,
        )
    channels = {setup.model.drive.channel: voltage}
    channels |= _measured(maker, setup, states, rng)
    return Recording(f"run{number + 1}", time, channels)


def _measured(maker, setup, states, rng) -> dict[str, np.ndarray]:
    found = {}
    for name, place in maker.channels.items():
        sensor = setup.model.sensors[name]
        noisy = states[:, place] + float(sensor.noise) * rng.standard_normal(
            len(states)
        )
        step = sensor.resolution
        found[name] = np.round(noisy / step) * step if step else noisy
    return found


def _flown(maker, truth, field, state, settle, time) -> np.ndarray:
    """States at `settle + time`, from impact to impact."""

    def event(k):
        def gap(t, x):
            return maker.gaps(truth, x)[k]

        gap.terminal, gap.direction = True, -1
        return gap

    events = [event(k) for k in range(len(maker.impacts))]
    wanted = settle + time
    found = np.zeros((len(time), len(state)))
    t, end, last = 0.0, wanted[-1], -1.0
    while t < end:
        part = solve_ivp(
            field,
            (t, end),
            state,
            "DOP853",
            events=events,
            dense_output=True,
            rtol=1e-10,
            atol=1e-13,
            max_step=0.02,
        )
        inside = (wanted >= t) & (wanted <= part.t[-1])
        if inside.any():
            found[inside] = part.sol(wanted[inside]).T
        t, state = float(part.t[-1]), part.y[:, -1]
        if part.status != 1:
            break
        struck = next(k for k, times in enumerate(part.t_events) if len(times))
        if t - last < _CHATTER:
            raise Accumulates
        state, last = maker.impacts[struck](truth, state), t
    return found
