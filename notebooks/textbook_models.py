"""Textbook models of three rigs with public recordings, for notebooks A3 and A4.

For each rig this module defines the model, its sensor and its parameters, and a
function that reads the recordings from a folder (notebook A3 lists their sources).
"""

from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxcam import HybridSystem
from jaxcam.fitting import Input, Model, Parameter, Sensor
from jaxcam.recordings import read_case, Recording, segment, Segments


class WithoutStop(HybridSystem):
    """A system without stops."""

    def gap(self, t, state):
        return state[0] + 100.0

    def impact(self, t, state):
        return state


class Pendulum(WithoutStop):
    """A rigid pendulum with viscous friction in the hinge: angle from the vertical, and
    its rate."""

    stiffness: float = 60.0
    damping: float = 0.05

    def vector_field(self, t, state):
        angle, rate = state
        pull = self.stiffness * jnp.sin(angle) + self.damping * rate
        return jnp.stack([rate, -pull])


# the encoder has 40000 counts per revolution and reads pi when the pendulum hangs
count = 2 * np.pi / 40000
pendulum = Model(
    Pendulum(), {"angle_rad": Sensor(0, noise=count / np.sqrt(12), offset=np.pi)}
)
hinge = [
    Parameter("stiffness", lambda m: m.system.stiffness, scale=0.1, lower=0.0),
    Parameter("damping", lambda m: m.system.damping, scale=0.01, lower=0.0),
    Parameter("zero", lambda m: m.sensors["angle_rad"].offset, tolerance=0.01),
]


def read_swings(folder: Path) -> list[Segments]:
    """Read the swings of the pendulum, each up to the time at which the pendulum stops.

    Every tenth sample is kept: 10 ms is an eightieth of the period, and at 1000 samples
    per second the rounding errors of neighbouring samples would be the same.
    """
    swings = []
    for run in read_case(folder / "pendulum", channels=("angle_rad",)):
        angle, clock = run["angle_rad"][::10], run.time[::10] - run.time[0]
        moving = np.flatnonzero(np.abs(angle - angle[-1]) > 2 * count)[-1] + 1
        part = Recording(run.name, clock[:moving], {"angle_rad": angle[:moving]})
        swings.append(segment(part, "angle_rad", noise=count / np.sqrt(12)))
    return swings


class Stage(WithoutStop):
    """A mass with viscous friction; the state is position (m) and velocity (m/s)."""

    inverse_mass: float = 0.0105
    viscous: float = 2.0
    offset: float = 0.0
    force: float = 0.0

    def vector_field(self, t, state):
        pushed = self.inverse_mass * self.force - self.offset
        return jnp.stack([state[1], pushed - self.viscous * state[1]])


# the noise is set to the resolution of the encoder (m)
stage = Model(
    Stage(),
    {"position_m": Sensor(0, noise=5e-8)},
    Input("motor_force_N", lambda system: system.force),
)
cart = [
    Parameter("1/mass", lambda m: m.system.inverse_mass, scale=1e-4, lower=0.0),
    Parameter("viscous", lambda m: m.system.viscous, scale=0.05, lower=0.0),
    Parameter("offset", lambda m: m.system.offset, scale=0.01),
]


def read_stage(folder: Path) -> list[Recording]:
    """Read the two recordings of the positioning stage."""
    return list(read_case(folder / "positioning_stage", channels=("position_m",)))


class Head(WithoutStop):
    """A mass with spring, damper and motor; the state is position and velocity."""

    gain: float = 100.0
    stiffness: float = 650.0
    damping: float = 13.0
    offset: float = 0.0
    voltage: float = 0.0

    def vector_field(self, t, state):
        pushed = -self.gain * self.voltage - self.offset
        pulled = self.stiffness * state[0] + self.damping * state[1]
        return jnp.stack([state[1], pushed - pulled])


head = Model(
    Head(),
    {"position_m": Sensor(0, noise=5e-6)},
    Input("voltage_V", lambda system: system.voltage),
)
spring = [
    Parameter("gain", lambda m: m.system.gain, scale=1.0, lower=0.0),
    Parameter("stiffness", lambda m: m.system.stiffness, scale=10.0, lower=0.0),
    Parameter("damping", lambda m: m.system.damping, scale=0.3, lower=0.0),
    Parameter("offset", lambda m: m.system.offset, scale=0.1),
]


def read_head(folder: Path) -> tuple[Recording, Recording, Recording]:
    """Return the recording of the mounting head, and its two halves."""
    (run,) = read_case(folder / "mounting_head", channels=("position_m",))
    first, second = (
        slower(run, "position_m", "voltage_V", 8, half)
        for half in (slice(0, 1875), slice(1875, 3750))
    )
    return run, first, second


def slower(run: Recording, channel: str, by: str, count: int, part=slice(None)):
    """Keep every `count`-th sample of a channel, and the mean input between these.

    The mean preserves the impulse of the input.
    """
    size = len(run) // count * count
    clock = run.time[:size:count][part]
    channels = {
        channel: run[channel][:size:count][part],
        by: run[by][:size].reshape(-1, count).mean(axis=1)[part],
    }
    name = run.name if part == slice(None) else f"{run.name}_{part.start}"
    return Recording(name, clock - clock[0], channels)
