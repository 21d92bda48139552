"""A driven mass beside a rigid wall, as a user states and records it."""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp


CODE = """
import jax.numpy as jnp
from jaxcam import HybridSystem


class Shaker(HybridSystem):
    state_names = ("position", "velocity")
    state_units = ("m", "m/s")
    constraint_names = ("wall",)

    mass: float = 0.5
    stiffness: float = 500.0
    damping: float = 0.8
    force: float = 5.0
    frequency: float = 6.0
    phase: float = 0.0
    wall: float = 0.015
    restitution: float = 0.8

    def vector_field(self, t, state):
        push = self.force * jnp.cos(2 * jnp.pi * self.frequency * t + self.phase)
        total = push - self.stiffness * state[0] - self.damping * state[1]
        return jnp.stack([state[1], total / self.mass])

    def gap(self, t, state):
        return self.wall - state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])

    @property
    def period(self):
        return 1 / self.frequency
"""
RIG = """
system = "shaker.py:Shaker"

[parameters]
mass = 0.5
force = 5.0
stiffness = {value = 500.0, tolerance = 15.0, unit = "N/m"}
damping = {value = 0.8, tolerance = 0.3, lower = 0.0, unit = "N s/m"}
wall = {value = 0.015, tolerance = 0.0003, unit = "m"}
restitution = {value = 0.8, tolerance = 0.1, lower = 0.0, upper = 1.0}

[channels.position_m]
sees = "position"
noise = 4.5e-5
resolution = 1e-6

[records."run_A*"]
frequency = 4.7

[records."run_B*"]
frequency = 6.2
"""
FREQUENCIES = {"run_A": 4.7, "run_B": 6.2}
NOISE = 4.5e-5


def write_rig(folder: Path, rig: str = RIG) -> Path:
    """Write the system and its rig file, and return the latter."""
    (folder / "shaker.py").write_text(CODE)
    (folder / "shaker.toml").write_text(rig)
    return folder / "shaker.toml"


def position(time: np.ndarray, frequency: float, phase: float) -> np.ndarray:
    """Positions (m) of a mass whose parameters are within the tolerances."""
    omega, wall = 2 * np.pi * frequency, 0.0151

    def field(t, y):
        push = 5.0 * np.cos(omega * t + phase)
        return [y[1], (push - 507.0 * y[0] - 0.75 * y[1]) / 0.5]

    def gap(t, y):
        return wall - y[0]

    gap.terminal, gap.direction = True, -1  # pyright: ignore
    x, t, y = np.zeros(len(time)), float(time[0]), np.array([0.0, 0.3])
    while t < time[-1]:
        span = (t, float(time[-1]))
        part = solve_ivp(
            field, span, y, "DOP853", None, True, [gap], rtol=1e-10, atol=1e-13
        )
        inside = (time >= t) & (time <= part.t[-1])
        x[inside] = part.sol(time[inside])[0]  # pyright: ignore
        t, y = part.t[-1], np.array([wall, -0.8 * part.y[1, -1]])
    return x


def write_case(
    folder: Path,
    phases=(0.4, 0.4),
    *,
    column: str = "position_m",
    scale: float = 1.0,
    offset: float = 0.0,
) -> Path:
    """Write two recordings of twelve periods; `scale` multiplies the positions, to
    which an `offset` (m) is added.
    """
    rng = np.random.default_rng(3)
    folder.mkdir()
    for (name, frequency), phase in zip(FREQUENCIES.items(), phases, strict=True):
        time = np.arange(1200) / (100 * frequency)
        seen = position(time, frequency, phase) + NOISE * rng.standard_normal(1200)
        np.savetxt(
            folder / f"{name}.csv",
            np.stack([time, scale * (seen + offset)], axis=1),
            delimiter=",",
            header=f"time_s,{column}",
            comments="",
            fmt=["%.6f", "%.9f"],
        )
    return folder
