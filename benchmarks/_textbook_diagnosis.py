"""Diagnose textbook oscillators, starting from a linear one."""

import math
import time
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks._textbook_cases import (
    Case,
    Motion,
    RESTITUTION_TOLERANCE,
    STOP_TOLERANCE,
    TOLERANCES,
)
from benchmarks._textbook_runs import run_freely
from jaxcam.discrepancy import diagnose, Diagnosis, Policy
from jaxcam.fitting import free_run, Input, Model, Parameter, Sensor, Setup
from jaxcam.hybrid import HybridSystem
from jaxcam.recordings import Recording


class Oscillator(HybridSystem):
    """A linear oscillator with an input and without impacts."""

    state_names = ("position", "velocity")
    state_units = ("m", "m/s")

    stiffness: float = 1.0  # 1/s^2
    damping: float = 0.0  # 1/s
    gain: float = 1.0
    input: float = 0.0

    def vector_field(self, t, state):
        x, v = state
        push = self.gain * self.input - self.stiffness * x - self.damping * v
        return jnp.stack([v, push])


class Stopped(Oscillator):
    """The same oscillator below a stop."""

    stop: float = 1.0  # m
    restitution: float = 0.5

    def gap(self, t, state):
        return self.stop - state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


def setup_of(case: Case, noise: float) -> Setup:
    """The textbook model with its tolerances."""
    nominal = case.nominal
    tolerances = {name: TOLERANCES[name] * abs(nominal[name]) for name in nominal}
    system = Oscillator(**nominal)
    if math.isfinite(case.stop):
        tolerances |= {
            "stop": STOP_TOLERANCE * case.stop,
            "restitution": RESTITUTION_TOLERANCE,
        }
        system = Stopped(
            **nominal,
            stop=case.stop + tolerances["stop"] / 3,
            restitution=case.restitution - RESTITUTION_TOLERANCE / 3,
        )
    sensors = {"position_m": Sensor(0, noise=noise)}
    parameters = tuple(
        Parameter(name, lambda m, name=name: getattr(m.system, name), tolerance)
        for name, tolerance in tolerances.items()
    )
    model = Model(system, sensors, Input("input", _input))
    return Setup(model, parameters, references={"spring_center": 0.0})


def recording(name: str, motion: Motion, position) -> Recording:
    """A recording of a motion."""
    return Recording(name, motion.time, {"position_m": position, "input": motion.input})


class Found:
    """A diagnosis, with its models ready to be simulated."""

    def __init__(self, case: Case, setup: Setup, runs, elements: int, progress=None):
        self.case, self.setup = case, setup
        begun, spent = time.time(), time.process_time()
        self.diagnosis: Diagnosis = diagnose(
            setup, runs, policy=Policy(elements=elements), progress=progress
        )
        self.seconds = time.time() - begun
        self.cpu = time.process_time() - spent

    def model(self, textbook: bool) -> Model:
        """The fitted textbook model, or the one with the terms that were found."""
        found = self.diagnosis
        if textbook:
            return found.before.model(0)
        if not any(one.element is not None for one in found.missing):
            return found.model()
        base = found.model()
        return Model(found.system(), base.sensors, self.setup.model.drive)

    def acceleration(self, motion: Motion, textbook: bool) -> np.ndarray:
        """Acceleration along a true motion, which also drives an added element."""
        system = self.model(textbook).system
        size = len(system.state_names or "xv") - 2
        own = jnp.zeros(max(size, 0))
        step = 1 / self.case.rate
        states, levels = jnp.asarray(motion.states[:, :2]), jnp.asarray(motion.input)
        bends = jnp.asarray(self._bends(motion))

        def field(x, level, own):
            system_now = _with_input(system, level)
            return system_now.vector_field(0.0, jnp.concatenate([x, own]))

        def between(one, bend, ahead, next_bend, share):
            """Position and velocity between samples, by Hermite's polynomial."""
            s, h = share, step
            x = (
                one[0] * (1 + 2 * s) * (1 - s) ** 2
                + one[1] * h * s * (1 - s) ** 2
                + ahead[0] * s**2 * (3 - 2 * s)
                + ahead[1] * h * s**2 * (s - 1)
            )
            v = (
                one[1] * (1 + 2 * s) * (1 - s) ** 2
                + bend * h * s * (1 - s) ** 2
                + ahead[1] * s**2 * (3 - 2 * s)
                + next_bend * h * s**2 * (s - 1)
            )
            return jnp.stack([x, v])

        def advance(own, inputs):
            one, bend, ahead, next_bend, level = inputs
            here = field(one, level, own)[1]
            for k in range(8):
                at = between(one, bend, ahead, next_bend, (k + 0.5) / 8)
                middle = own + step / 16 * field(at, level, own)[2:]
                own = own + step / 8 * field(at, level, middle)[2:]
            return own, here

        inputs = (states, bends[0], jnp.roll(states, -1, 0), bends[1], levels)
        # one period to reach the steady state of the element
        own, _ = jax.lax.scan(advance, own, inputs)
        return np.asarray(jax.lax.scan(advance, own, inputs)[1])

    def _bends(self, motion: Motion):
        """True accelerations at both ends of each interval."""
        case = self.case
        ahead = np.roll(motion.states, -1, axis=0)
        rows = zip(motion.states, ahead, motion.input)
        both = [
            (case.field(x, 0.0, u)[1], case.field(y, 0.0, u)[1]) for x, y, u in rows
        ]
        return np.array(both).T

    def free(self, held: Recording, textbook: bool) -> np.ndarray:
        """Positions of a free run."""
        model = self.model(textbook)
        if not math.isfinite(self.case.stop):
            return np.asarray(free_run(model, held).simulated["position_m"])

        @jax.jit
        def rates(x, u):
            return _with_input(model.system, u).vector_field(0.0, x)

        values: dict[str, Any] = {
            name: float(getattr(_bare(model.system), name))
            for name in ("stop", "restitution")
        }
        return run_freely(
            lambda x, u: np.asarray(rates(np.asarray(x), u)).tolist(),
            self.case.rate,
            held["input"],
            held["position_m"],
            **values,
        )


def _bare(system) -> Any:
    while hasattr(system, "base"):
        system = system.base
    return system


def _input(system) -> Any:
    return _bare(system).input


def _with_input(system, level):
    return eqx.tree_at(_input, system, level)
