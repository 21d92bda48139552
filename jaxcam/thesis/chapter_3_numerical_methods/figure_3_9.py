"""Figure 3.9: the start of the P(inf,1) branch, and the speed at which its sticking
time vanishes.
"""

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ... import plotting
from ...models import CamFollower, rad_s_to_rpm
from ...plotting.colours import FLIGHT, SECOND
from ..chapter_5_bifurcations.figure_5_24 import sticking_times
from ..interruption import INTERRUPTION, interruption
from ..progress import of_branch
from ..remember import remembered
from ..speeds import at_rpm, speed_of
from ..target import Rows, Target
from .branches import bounds, special_speed, START_RPM


if TYPE_CHECKING:
    from continuation import Branch


_LOWEST = 115.0
"""Lowest speed of the branch (rpm)."""
_PAST = 0.01
"""Distance beyond the interruption at which the sticking branch ends (rpm)."""


@remembered
def sticking_branch(system: CamFollower) -> "Branch":
    """Follow P(inf,1) from detachment to the interruption of chatter."""
    import continuation

    rig = at_rpm(system, START_RPM)
    end = float(rad_s_to_rpm(interruption(system).speed)) + _PAST
    start = continuation.periodic_orbits(rig, continuation.periodic_orbit(rig))
    return continuation.branch(
        start.problem,
        start,
        speed_of,
        bounds((_LOWEST, end)),
        direction="both",
        callbacks=[of_branch(_LOWEST, end)],
    )


def sticking_along(branch: "Branch") -> list[tuple[float, float]]:
    """Return speed (rpm) and sticking time (s) of the orbits that stick."""
    return [
        (float(rad_s_to_rpm(p.parameter)), float(p.observed["sticking time"]))
        for p in branch.points
        if "sticking time" in p.observed
    ]


def compute(system: CamFollower) -> Rows:
    branch = sticking_branch(system)
    times = sticking_times(system)[1]
    return [
        (
            "detachment",
            125.0,
            special_speed(branch, "detachment"),
            "rpm",
        ),
        (
            "interruption of chatter",
            INTERRUPTION,
            special_speed(branch, "interruption of chatter"),
            "rpm",
        ),
        ("sticking time 1e-5 rpm below it", 0.0, times[-1], "s"),
        ("orbits on the branch", np.nan, len(branch.regular), ""),
    ]


def draw(system: CamFollower) -> Figure:
    branch = sticking_branch(system)
    figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.4))
    scale = 30 / np.pi
    plotting.branch_diagram(
        branch, axes[0], x_label=("speed", "rpm"), y_label=("angle", "rad"),
        x_scale=scale,
    )  # fmt: skip
    speeds, times, _ = sticking_times(system)
    axes[1].plot(speeds, 1e3 * times, color=FLIGHT, label="simulated")
    speeds, times = np.array(sticking_along(branch)).T
    axes[1].plot(speeds, 1e3 * times, "o", ms=3.5, color=SECOND, label="continuation")
    axes[1].legend()
    for point in branch.special:
        axes[1].axvline(scale * point.parameter, color=SECOND, ls=":", lw=1.2)
    axes[1].axhline(0, color="0.4", lw=0.7)
    axes[1].set_xlabel("speed (rpm)")
    axes[1].set_ylabel("sticking time per cycle (ms)")
    return figure


TARGET = Target("The sticking branch up to its interruption", compute, draw)
