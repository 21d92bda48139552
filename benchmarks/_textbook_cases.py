"""Textbook oscillators with a known input, simulated by scipy.

The mass is driven by a random-phase multisine that is held between samples. All numbers
are per unit of mass. The code shares nothing with the package.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import odeint, solve_ivp


# Number of samples of a recording: one period of its input, preceded by another period
SAMPLES = 2048
# Recordings from which a model is learnt, with the size of the input in each
SIZES = (1.0, 0.7, 0.85)
# Tolerances of a linear oscillator, relative to its parameters
TOLERANCES = {"stiffness": 0.05, "damping": 0.5, "gain": 0.02}
# Tolerances of the stop, as a fraction of its position, and of the restitution
STOP_TOLERANCE, RESTITUTION_TOLERANCE = 0.005, 0.08


class Case(NamedTuple):
    """An oscillator `x'' = gain u - stiffness x - damping v + force`.

    - `rate` (Hz) of the samples; `band` (Hz) and `rms` of the input.
    - `force(x, v, z)`: the part that no linear oscillator has.
    - `memory(v, z)`: rate of change of the internal state z of the force, if any.
    - `linear`: nominal stiffness, if it is not that of the oscillator alone.
    - `stop`, `restitution`: position of a stop above the mass, and coefficient of
        restitution of impacts on it.
    """

    rate: float
    band: tuple[float, float]
    rms: float
    truth: dict[str, float]
    force: Callable[[float, float, float], float]
    memory: Callable[[float, float], float] | None = None
    linear: float | None = None
    stop: float = math.inf
    restitution: float = 0.0

    @property
    def nominal(self) -> dict[str, float]:
        """The numbers that a user would state, off by a third of their tolerances."""
        found = self.truth | {"stiffness": self.linear or self.truth["stiffness"]}
        signs = {"stiffness": 1, "damping": -1, "gain": 1}
        return {
            name: value * (1 + signs[name] * TOLERANCES[name] / 3)
            for name, value in found.items()
        }

    def field(self, x, t: float, u: float):
        """Rate of change of the state."""
        del t
        position, velocity, *own = x
        z = own[0] if own else 0.0
        p = self.truth
        push = p["gain"] * u - p["stiffness"] * position - p["damping"] * velocity
        rates = [velocity, push + self.force(position, velocity, z)]
        if self.memory is not None:
            rates.append(self.memory(velocity, z))
        return rates


class Motion(NamedTuple):
    """A simulated recording: its `time`, `input`, `states` `(n, d)` at the samples, and
    the instants of its `impacts`."""

    time: np.ndarray
    input: np.ndarray
    states: np.ndarray
    impacts: np.ndarray


# Natural frequency and hardening of the Silverbox, with a static gain of one
_OMEGA = 2 * math.pi * 68.0
_CUBIC = 4.0 * _OMEGA**2
_BOX = {"stiffness": _OMEGA**2, "damping": 0.1 * _OMEGA, "gain": _OMEGA**2}
_SILVER = Case(2441.4, (1.0, 200.0), 0.04, _BOX, lambda x, v, z: -_CUBIC * x**3)


def _bouc_wen(mass, damping, stiffness, alpha, beta, gamma, delta, rms) -> Case:
    """The oscillator of Noel and Schoukens (2016), with exponent 1."""
    truth = {"stiffness": stiffness / mass, "damping": damping / mass, "gain": 1 / mass}

    def memory(v, z):
        return alpha * v - beta * (gamma * abs(v) * z + delta * v * abs(z))

    return Case(
        750.0,
        (5.0, 150.0),
        rms,
        truth,
        lambda x, v, z: -z / mass,
        memory,
        (stiffness + alpha) / mass,
    )


CASES = {
    "duffing": _SILVER,
    # the published parameters, with which the loop is steeper after a reversal
    "bouc_wen": _bouc_wen(2.0, 10.0, 5e4, 5e4, 1e3, 0.8, -1.1, 50.0),
    # a loop that saturates, at a restoring force of 20 N
    "bouc_wen_slip": _bouc_wen(2.0, 10.0, 5e4, 5e4, 2.5e3, 0.6, 0.4, 50.0),
    "duffing_stop": _SILVER._replace(stop=0.1, restitution=0.7),
}


def multisine(case: Case, size: float, rng) -> np.ndarray:
    """One period of an input with random phases and equal amplitudes in its band."""
    hertz = np.fft.rfftfreq(SAMPLES, 1 / case.rate)
    low, high = case.band
    lines = (hertz >= low) & (hertz <= high)
    waves = lines * np.exp(2j * math.pi * rng.uniform(0, 1, len(hertz)))
    found = np.fft.irfft(waves, SAMPLES)
    return case.rms * size * found / np.sqrt(np.mean(found**2))


def moved(case: Case, u: np.ndarray) -> Motion:
    """The motion in the second period of an input, from rest."""
    step = 1 / case.rate
    state = np.zeros(2 if case.memory is None else 3)
    states, impacts = [], []
    for k, level in enumerate(np.concatenate([u, u])):
        if k >= SAMPLES:
            states.append(state)
        after = odeint(
            case.field, state, [0.0, step], (level,), rtol=1e-11, atol=1e-13
        )[1]
        # near the stop, integrate again with event location, to miss no impact
        near = max(state[0] + step * abs(state[1]), after[0] + step * abs(after[1]))
        if near < case.stop:
            state = after
            continue
        state, struck = _past_stop(case, state, level, step)
        impacts += [(k - SAMPLES) * step + t for t in struck if k >= SAMPLES]
    time = step * np.arange(SAMPLES)
    return Motion(time, u, np.array(states), np.array(impacts))


def _past_stop(case: Case, state, level: float, step: float):
    """The state after an interval with impacts on the stop, and their times."""

    def reached(t, x):
        return case.stop - x[0]

    reached.terminal, reached.direction = True, -1
    t, struck = 0.0, []
    while t < step:
        part = solve_ivp(
            lambda t, x: case.field(x, t, level),
            (t, step),
            state,
            "DOP853",
            events=reached,
            rtol=1e-11,
            atol=1e-13,
        )
        t, state = float(part.t[-1]), part.y[:, -1]
        if part.status == 1:
            state = np.array([case.stop, -case.restitution * state[1], *state[2:]])
            struck.append(t)
    return state, struck


def motions(case: Case, seed: int) -> tuple[list[Motion], Motion]:
    """Motions to learn from, and a held-out one."""
    rng = np.random.default_rng(seed)
    learnt = [moved(case, multisine(case, size, rng)) for size in SIZES]
    return learnt, moved(case, multisine(case, 1.0, rng))


def measured(motion: Motion, noise: float, seed: int) -> np.ndarray:
    """The position with noise."""
    rng = np.random.default_rng(seed)
    return motion.states[:, 0] + noise * rng.standard_normal(len(motion.time))


def extra_force(case: Case, motion: Motion) -> np.ndarray:
    """The acceleration that no linear oscillator has, along a motion."""
    x, v = motion.states[:, 0], motion.states[:, 1]
    z = motion.states[:, 2] if case.memory is not None else np.zeros(len(x))
    force = case.force(x, v, z)
    known = np.stack([np.ones(len(x)), x, v, motion.input], axis=1)
    known = known / np.linalg.norm(known, axis=0)
    return force - known @ np.linalg.lstsq(known, force, rcond=None)[0]


def acceleration(case: Case, motion: Motion) -> np.ndarray:
    """The true acceleration along a motion."""
    return np.array(
        [case.field(x, 0.0, u)[1] for x, u in zip(motion.states, motion.input)]
    )
