"""Simulate recordings of the rigs in `docs/rigs`, without any code from the package.

Each rig is defined again as plain functions of numbers, and integrated from impact to
impact with scipy's DOP853.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks._hidden_physics import by_kind, Hidden
from jaxcam.recordings import Recording


INTERVAL, SETTLE = 5e-4, 8.0
_COUNT = 2 * math.pi / 20000  # one count of the encoder on the drive (rad)
_DRIVE_NOISE = 1e-4
# A rig whose impacts are closer together than this (s) is redrawn
_CHATTER = 2e-3


class Maker(NamedTuple):
    """The motion of a rig.

    - `field(p, x, drive, u)`: rate of change of the state, given the angle, rate and
        acceleration of the drive, or an input.
    - `gaps(p, x)`, and `impacts`, one impact law `(p, x)` for each gap.
    - `start`: initial state; `speeds` (rad/s): smallest and largest, for a driven rig.
    - `channels`: name of each channel, and the state component that it measures.
    - `restitution`: the parameter of the impact law of the first gap; `second`: that of
        the second gap, if its impacts are also impacts of the first coordinate.
    """

    field: Callable
    gaps: Callable
    impacts: tuple[Callable, ...]
    start: tuple[float, ...]
    channels: dict[str, int]
    speeds: tuple[float, float] | None = None
    restitution: str = ""
    second: str = ""

    def at_second_gap(self) -> "Maker":
        """The same rig, with hidden effects at its second gap instead of the first."""
        return self._replace(
            gaps=lambda p, x: self.gaps(p, x)[::-1],
            impacts=self.impacts[::-1],
            restitution=self.second,
            second=self.restitution,
        )


class Accumulates(Exception):
    """Impacts accumulate, which the tests of these rigs exclude."""


def _two_stops(p, x, drive, u):
    phi, w, a = drive
    base = p["base_amplitude"] * (a * math.cos(phi) - w * w * math.sin(phi))
    pull = p["stiffness_over_mass"] * x[0] + p["damping_over_mass"] * x[1]
    return x[1], -pull - base


def _pendulum(p, x, drive, u):
    phi, w, a = drive
    base = a * math.cos(phi) - w * w * math.sin(phi)
    base *= p["base_amplitude_over_length"]
    weight = p["gravity_over_length"] * math.sin(x[0])
    return x[1], -weight - p["damping"] * x[1] - base * math.cos(x[0])


def _two_masses(p, x, drive, u):
    shaken = p["shaker_amplitude"] * math.sin(drive[0])
    a1 = -p["k1_over_m1"] * (x[0] - p["rest1"]) - p["c1_over_m1"] * x[1]
    a2 = -p["k2_over_m2"] * (x[2] - p["rest2"] - shaken) - p["c2_over_m2"] * x[3]
    return x[1], a1, x[3], a2


def _stage(p, x, drive, u):
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
        "restitution_left",
        "restitution_right",
    ),
    "pendulum_wall": Maker(
        _pendulum,
        lambda p, x: (x[0] - p["wall"],),
        (_reflected("restitution"),),
        (0.2, 0.5),
        {"angle_rad": 0},
        (6.5, 18.0),
        "restitution",
    ),
    "two_masses": Maker(
        _two_masses,
        lambda p, x: (x[0], x[2] - x[0]),
        (_reflected("restitution_wall"), _collided),
        (0.004, 0.0, 0.012, 0.1),
        {"position1_m": 0, "position2_m": 2},
        (40.0, 62.0),
        "restitution_wall",
    ),
    "stage": Maker(_stage, lambda p, x: (), (), (0.0, 0.0), {"position_m": 0}),
}


class Motion(NamedTuple):
    """The motion behind a record: `states` `(n, d)` and the drive's `angle` `(n,)` at
    `time` `(n,)`, the `hertz` of the drive, and a row `(time, approach speed, angle)`
    for each impact on the first constraint.
    """

    time: np.ndarray
    states: np.ndarray
    angle: np.ndarray
    hertz: float
    struck: np.ndarray


def record_case(
    name: str, setup, truth: dict[str, float], rng, *, duration=6.0, records=4
) -> list[Recording]:
    """Make recordings of one rig at several speeds, or with several inputs.

    **Raises:** `Accumulates` if the rig comes to rest on a constraint.
    """
    return [run for run, _ in made_case(name, setup, truth, rng, (), duration, records)]


def made_case(
    name: str,
    setup,
    truth: dict[str, float],
    rng,
    hidden: Sequence[Hidden],
    duration: float = 6.0,
    records: int = 4,
    speeds: tuple[float, float] | None = None,
) -> list[tuple[Recording, Motion]]:
    """Make recordings with hidden effects, and return them with the underlying motions.

    `speeds`: smallest and largest, instead of those of the rig.
    """
    maker, found, kinds = MAKERS[name], [], by_kind(hidden)
    for k in range(records):
        if maker.speeds is None:
            motion, channels = _with_input(maker, setup, truth, rng, duration, kinds)
            called = f"run{k + 1}"
        else:
            ends = speeds or maker.speeds
            low, high = np.linspace(*ends, records + 1)[k : k + 2]
            speed = float(rng.uniform(low, high))
            motion, channels = _driven(maker, setup, truth, rng, duration, speed, kinds)
            called = f"run{k + 1}_{speed / (2 * math.pi):.3f}Hz"
        channels |= _measured(maker, setup, motion, rng, kinds)
        found.append((Recording(called, motion.time, channels), motion))
    return found


def _driven(maker, setup, truth, rng, duration, speed, hidden):
    shift = rng.uniform(0, 2 * math.pi, 3)

    def drive(t):
        """Angle, rate and acceleration of a drive whose speed wanders by 0.02 %."""
        angle, rate, acceleration = speed * t + shift[0], speed, 0.0
        for share, hertz, lead in ((0.7, 0.29, shift[1]), (0.3, 0.83, shift[2])):
            v = 2 * math.pi * hertz
            angle += speed * 2e-4 * share * math.sin(v * t + lead) / v
            rate += speed * 2e-4 * share * math.cos(v * t + lead)
            acceleration -= speed * 2e-4 * share * math.sin(v * t + lead) * v
        return angle, rate, acceleration

    time = INTERVAL * np.arange(round(duration / INTERVAL))
    flight = _Flight(maker, truth, drive, hidden, SETTLE)
    states, struck = flight.flown(np.array(maker.start), SETTLE, time)
    angle = np.array([drive(SETTLE + t)[0] for t in time])
    turns = 2 * math.pi * math.floor(angle[0] / (2 * math.pi))
    noisy = angle - turns + _DRIVE_NOISE * rng.standard_normal(len(time))
    channels = {setup.drive_channel: np.round(noisy / _COUNT) * _COUNT}
    hertz = speed / (2 * math.pi)
    return Motion(time, states, angle, hertz, struck), channels


def _with_input(maker, setup, truth, rng, duration, hidden):
    """A smooth random voltage, held between samples."""
    time = INTERVAL * np.arange(round(duration / INTERVAL))
    voltage = np.zeros(len(time))
    for hertz in rng.uniform(0.2, 3.0, 4):
        voltage += rng.uniform(0.3, 0.8) * np.sin(
            2 * math.pi * hertz * time + rng.uniform(0, 2 * math.pi)
        )
    voltage = np.round(np.clip(voltage, -1.5, 1.5), 3)
    flight = _Flight(maker, truth, lambda t: (0.0, 1.0, 0.0), hidden, 0.0)
    states = flight.held(np.array(maker.start), voltage)
    channels = {setup.model.drive.channel: voltage}
    none = np.zeros(len(time))
    return Motion(time, states, none, 1.0, np.zeros((0, 3))), channels


def _measured(maker, setup, motion, rng, hidden) -> dict[str, np.ndarray]:
    found = {}
    for number, (name, place) in enumerate(maker.channels.items()):
        sensor = setup.model.sensors[name]
        shown = np.array(motion.states[:, place])
        if "sensor" in hidden and not number:
            x, v = motion.states[:, 0], motion.states[:, 1]
            shown += hidden["sensor"].at(x, v, motion.angle, motion.time)
        noisy = shown + float(sensor.noise) * rng.standard_normal(len(shown))
        step = sensor.resolution
        found[name] = np.round(noisy / step) * step if step else noisy
    return found


class _Flight:
    """A rig with its hidden effects by kind, integrated from impact to impact.

    `begin` is the time at which the record begins. The states of an effect are appended
    to those of the rig.
    """

    def __init__(self, maker, truth, drive, hidden, begin):
        self.maker, self.truth, self.drive = maker, truth, drive
        self.hidden, self.begin = hidden, begin
        self.own = len(maker.start)
        self.states = sum(one.effect.states for one in hidden.values())

    def field(self, t, x, u=0.0):
        drive = self.drive(t)
        found = list(self.maker.field(self.truth, x[: self.own], drive, u))
        own, rates = x[self.own :], ()
        for kind, one in self.hidden.items():
            if kind in ("force", "resonance"):
                more = own[0] if one.effect.states else 0.0
                found[1] += one.at(x[0], x[1], drive[0], t - self.begin, more)
                rates = (*rates, *one.rates(own, x[0], x[1]))
        return [*found, *rates]

    def surface(self, t):
        """Outward displacement of the first surface."""
        if "surface" not in self.hidden:
            return 0.0
        angle = self.drive(t)[0]
        return float(self.hidden["surface"].at(0.0, 0.0, angle, t - self.begin))

    def gap(self, k):
        def gap(t, x):
            found = self.maker.gaps(self.truth, x[: self.own])[k]
            return found - self.surface(t) if k == 0 else found

        gap.terminal, gap.direction = True, -1
        return gap

    def after(self, k, t, x):
        """The state after an impact on a constraint."""
        truth, small = self.truth, 1e-4
        rate = (self.surface(t + small) - self.surface(t - small)) / (2 * small)
        moved = np.array(x[: self.own])
        if k == 0:
            moved[1] -= rate
        if k == 0 and "restitution" in self.hidden:
            angle, law = self.drive(t)[0], self.hidden["restitution"]
            speed = abs(x[1]) / law.scales.velocity
            more = law.at(x[0], x[1], angle, t - self.begin, speed)
            name = self.maker.restitution
            truth = truth | {name: truth[name] * math.exp(more)}
        after = self.maker.impacts[k](truth, moved)
        if k == 0:
            after[1] += rate
        return np.concatenate([after, x[self.own :]])

    def flown(self, state, settle, time):
        """States of the rig at `settle + time`, and impacts on the first constraint."""
        state = np.concatenate([state, np.zeros(self.states)])
        events = [self.gap(k) for k in range(len(self.maker.impacts))]
        wanted, struck = settle + time, []
        found = np.zeros((len(time), len(state)))
        t, end, last = 0.0, wanted[-1], -1.0
        while t < end:
            part = solve_ivp(
                self.field,
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
            k = next(k for k, times in enumerate(part.t_events) if len(times))
            if t - last < _CHATTER:
                raise Accumulates
            if k == 0 and t >= settle:
                struck.append((t - settle, abs(state[1]), self.drive(t)[0]))
            state, last = self.after(k, t, state), t
        return found[:, : self.own], np.array(struck).reshape(-1, 3)

    def held(self, state, inputs):
        """States at every sample, with an input held constant between samples."""
        state = np.concatenate([state, np.zeros(self.states)])
        found, parts = [state], 4
        h = INTERVAL / parts
        for k, u in enumerate(inputs[:-1]):
            for j in range(parts):
                t = k * INTERVAL + j * h
                a = np.array(self.field(t, state, u))
                b = np.array(self.field(t + h / 2, state + h / 2 * a, u))
                c = np.array(self.field(t + h / 2, state + h / 2 * b, u))
                d = np.array(self.field(t + h, state + h * c, u))
                state = state + h / 6 * (a + 2 * b + 2 * c + d)
            found.append(state)
        return np.array(found)[:, : self.own]
