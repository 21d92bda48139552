"""Figure 5.24: the sticking time falls to zero by a power law close to a square
root.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational import chatter_accumulation, scaling_law

from ...hybrid.programs import program
from ...models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ...plotting.colours import FLIGHT, IMPACT, RECORDED
from ..interruption import beside_interruption, interruption
from ..remember import remembered
from ..speeds import speed_of
from ..target import Rows, Target


_BELOW = 152.65
"""Speed (rpm) at which the sticking time is given."""


@program
def _sticking(system, speeds):
    def one(speed):
        rig = eqx.tree_at(speed_of, system, speed)
        found = chatter_accumulation(rig)
        return found.frame.release + rig.period - found.accumulation

    return jax.vmap(one)(speeds)


@remembered
def sticking_times(system: CamFollower) -> tuple[np.ndarray, np.ndarray, float]:
    """Return speeds (rpm) up to the interruption, the sticking times (s) at these
    speeds, and the speed of the interruption (rpm).

    Sticking times are exact, however short they are; the distances of the speeds from
    the interruption are spaced logarithmically.
    """
    end = float(rad_s_to_rpm(interruption(system).speed))
    speeds = end - np.geomspace(20.0, 1e-5, 120)
    times = _sticking(system, jnp.asarray(rpm_to_rad_s(speeds)))
    return speeds, np.asarray(times), end


def compute(system: CamFollower) -> Rows:
    speeds, times, end = sticking_times(system)
    near = (end - speeds < 1e-2) & (times > 0)
    power = np.polyfit(np.log(end - speeds[near]), np.log(times[near]), 1)[0]
    rig = interruption(system)
    law = scaling_law(rig.restitution(rig.speed, jnp.zeros(())))  # pyright: ignore
    kappa = float(law.kappa)
    below = beside_interruption(system, _BELOW)
    at = np.interp(below, speeds, times)
    return [
        ("speed at which sticking ends", 152.67, end, "rpm"),
        ("exponent of the decrease (a square root in the text)", 0.5, power, ""),
        ("the same from theory, kappa/2", 0.5, kappa / 2, ""),
        (f"sticking time at {below:g} rpm", np.nan, at, "s"),
    ]


def draw(system: CamFollower) -> Figure:
    speeds, times, end = sticking_times(system)
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.9))
    axes[0].plot(speeds, 1e3 * times, color=FLIGHT)
    axes[0].axvline(end, color=IMPACT, ls=":", lw=1.2)
    axes[0].set_xlabel("speed (rpm)")
    axes[0].set_ylabel("sticking time per cycle (ms)")
    below = end - speeds
    axes[1].loglog(below, 1e3 * times, color=FLIGHT, label="simulated")
    root = times[-1] * np.sqrt(below / below[-1])
    axes[1].loglog(below, 1e3 * root, "--", color=RECORDED, label="square root")
    axes[1].set_xlabel("speed below the interruption (rpm)")
    axes[1].legend()
    return figure


TARGET = Target("Sticking time against speed", compute, draw)
