"""Figure 5.28: widths of the attractors of the map and of the motion.

The thesis draws only the map, without a scale of speeds.
"""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational import composed_map, find_lobes, fit_local_map, iterate_local_map

from ...models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ...plotting.colours import FLIGHT, IMPACT
from ..interruption import interruption, sticking_state
from ..progress import of_share
from ..remember import remembered
from ..speeds import at_speed, speed_of
from ..target import Rows, Target
from .figure_5_11 import onset


_RANK = 37
"""Index of the impact at which the local theory starts (docs/chatter.md)."""
_AFTER = 0.05, 0.1, 0.15
"""Distances (rpm) from the interruption at which the map and the motion are
compared.
"""
_SHIFTS = 600


class Iterated(NamedTuple):
    """The data of Figure 5.28: angles relative to the sticking state."""

    speeds: np.ndarray
    """Speeds (rpm) at which the map is iterated, shape `(k,)`."""
    attractor: np.ndarray
    """Iterates of the map (rad), shape `(k, kept)`."""
    motion_speeds: np.ndarray
    """Speeds (rpm) at which the motion is simulated, shape `(l,)`."""
    motion: np.ndarray
    """Samples of the motion (rad), shape `(l, kept)`."""
    rate: float
    """Shift of the map per unit of speed (rad/rpm)."""
    interruption: float
    """Speed of the interruption of chatter (rpm)."""


@remembered
def iterated(system: CamFollower, size: str) -> Iterated:
    """Iterate the map along the direction in which motions leave the lobes, and
    simulate the motion.
    """
    rig = interruption(system)
    composed = composed_map(rig, speed_of, _RANK)
    per_rpm = float(rpm_to_rad_s(1.0))
    along = float(composed.incidence * composed.vector[0] / composed.feedback)
    rate = along * per_rpm
    span = 1e-3
    deviations = np.linspace(-span / 4, span, 320)
    lobes = find_lobes(
        rig,
        composed.state,
        deviations,
        direction=composed.vector,
        most=6,
        progress=of_share("measuring lobes"),
    )
    local = fit_local_map(lobes)
    end = float(rad_s_to_rpm(rig.speed))
    made = onset(system, size)
    speeds = np.asarray(rad_s_to_rpm(made.values))
    fine = np.linspace(speeds[0], speeds[-1], _SHIFTS)
    start = float(local.x_inf - local.alpha_inf)
    shifts = start + rate * (fine - end)
    attractor = np.asarray(iterate_local_map(local, shifts)) - float(local.alpha_inf)
    rest = np.array(
        [float(sticking_state(at_speed(system, v))[0][0]) for v in made.values]
    )
    motion = made.states[:, 0, :, 0] - rest[:, None]
    return Iterated(fine, attractor, speeds, motion, rate, end)


def compute(system: CamFollower, size: str) -> Rows:
    found = iterated(system, size)
    rows: Rows = [("shift of the map per rpm", np.nan, found.rate, "rad/rpm")]
    for after in _AFTER:
        for word, speeds, states in (
            ("motion", found.motion_speeds, found.motion),
            ("map", found.speeds, found.attractor),
        ):
            near = np.abs(speeds - found.interruption - after) < 0.01
            rows += [
                (
                    f"{word}, {after} rpm above: lowest",
                    np.nan,
                    np.nanmin(states[near]),
                    "rad",
                ),
                (
                    f"{word}, {after} rpm above: highest",
                    np.nan,
                    np.nanmax(states[near]),
                    "rad",
                ),
            ]
    return rows


def draw(system: CamFollower, size: str) -> Figure:
    found = iterated(system, size)
    figure, axes = plt.subplots(2, 1, figsize=(8.4, 7.2), sharex=True, sharey=True)
    for ax, speeds, states, name, colour in (
        (axes[0], found.speeds, found.attractor, "fitted map, iterated", FLIGHT),
        (axes[1], found.motion_speeds, found.motion, "motion", IMPACT),
    ):
        x = np.repeat(speeds, states.shape[1])
        ax.plot(x, states.ravel(), ".", ms=1.8, mew=0, color=colour, rasterized=True)
        ax.set_title(name)
        ax.set_ylabel("deviation (rad)")
    axes[0].set_ylim(-6e-4, 8e-4)
    axes[1].set_xlabel("speed (rpm)")
    axes[1].ticklabel_format(axis="x", useOffset=False)
    return figure


TARGET = Target(
    "The iterated local map",
    compute,
    draw,
    sized=True,
    note="No dots are drawn at speeds where the iterated map leaves the largest fitted "
    "lobe.",
)
