"""Figure 4.13: free motion of the follower, with the fitted M = J/K.

The thesis gives neither the recording behind the figure nor its initial angle.
"""

import diffrax
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

from ...hybrid.programs import program
from ...models import CamFollower
from ..target import Rows, Target


_LET_GO = 0.75
"""Angle at which the free follower is released (rad); not given in the thesis."""
_HANGING = (-1.55, 0.0)
"""Range in which the equilibrium angle is searched for (rad)."""


@program
def _spring(system, angle):
    """Return the spring torque at an angle, and the stiffness there."""
    torque = jax.grad(system.potential_energy)
    return torque(angle), jax.grad(torque)(angle)


def equilibrium(system: CamFollower) -> float:
    """Return the equilibrium angle (rad) of the free follower, below the cam."""
    low, high = _HANGING

    def torque(angle):
        return float(_spring(system, jnp.asarray(angle))[0])

    return float(brentq(torque, low, high))  # pyright: ignore


@program
def fall_angles(system: CamFollower, times) -> jax.Array:
    """Return the angle (rad) of the free follower, released at 0.75 rad, at `times`
    (s).
    """
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: system.vector_field(t, y)),
        diffrax.Dopri8(),
        times[0],
        times[-1],
        None,
        jnp.array([_LET_GO, 0.0]),
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.PIDController(rtol=1e-10, atol=1e-10),
    )
    assert solution.ys is not None
    return solution.ys[:, 0]


def compute(system: CamFollower) -> Rows:
    rest = equilibrium(system)
    _, stiffness = _spring(system, jnp.asarray(rest))
    frequency = np.sqrt(float(stiffness / system.inertia)) / (2 * np.pi)
    ratio = system.inertia / system.stiffness
    return [
        ("M = J/K", 0.043 / 105, ratio, "m s^2"),
        ("equilibrium angle", np.nan, rest, "rad"),
        ("frequency of small oscillations about it", np.nan, frequency, "Hz"),
    ]


def draw(system: CamFollower) -> Figure:
    figure, ax = plt.subplots()
    times = np.linspace(0, 1, 800)
    ax.plot(times, np.asarray(fall_angles(system, jnp.asarray(times))))
    ax.set_xlabel("time (s)")
    ax.set_ylabel("follower angle (rad)")
    return figure


TARGET = Target("The follower without the cam", compute, draw)
