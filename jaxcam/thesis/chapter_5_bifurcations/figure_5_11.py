"""Figure 5.11: the end of P(inf,1), and the periodic windows beyond it."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ... import sweeps
from ...models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ..diagrams import draw_diagram
from ..interruption import beside_interruption, INTERRUPTION, interruption
from ..progress import of_sweep
from ..remember import remembered
from ..target import Rows, Target
from .figure_5_1 import KEEP, TURNS


_ZOOM = 152.6, 153.2
"""Speed range of Figure 5.11 (rpm)."""
_ZOOMED = {"default": 401, "full": 2001}
"""Number of speeds in this range."""


@remembered
def onset(system: CamFollower, size: str) -> sweeps.Diagram:
    """Compute the diagram of Figure 5.11; the motion at each speed starts from contact
    at rest.
    """
    low, high = (beside_interruption(system, rpm) for rpm in _ZOOM)
    speeds = np.linspace(low, high, _ZOOMED[size])
    return sweeps.diagram(
        system,
        "speed",
        rpm_to_rad_s(speeds),
        turns=TURNS,
        keep=KEEP,
        progress=of_sweep("sweeping the speed at the interruption"),
    )


def compute(system: CamFollower, size: str) -> Rows:
    made = onset(system, size)
    speeds = np.asarray(rad_s_to_rpm(made.values))
    labels = made.labels[:, 0]
    # a failed run gives no information about the motion at its speed
    known = labels != "failed"
    other = known & (labels != "P(inf,1)")
    first = speeds[other].min() if np.any(other) else np.nan
    behind = labels[known & (speeds >= first)]
    repeats = np.char.startswith(behind.astype(str), "P(")
    changes = int(np.count_nonzero(np.diff(repeats.astype(int))))
    exact = rad_s_to_rpm(interruption(system).speed)
    return [
        ("first speed without P(inf,1)", 152.67, first, "rpm"),
        ("interruption", INTERRUPTION, exact, "rpm"),
        (
            "fraction of the speeds above it with a periodic motion",
            np.nan,
            np.mean(repeats),
            "",
        ),
        ("transitions between windows and chaos", np.nan, changes, ""),
        ("speeds at which the run failed", np.nan, np.count_nonzero(~known), ""),
    ]


def draw(system: CamFollower, size: str) -> Figure:
    made = onset(system, size)
    figure, ax = plt.subplots(figsize=(8.4, 4.8))
    draw_diagram(made, ax)
    ax.ticklabel_format(useOffset=False)
    return figure


TARGET = Target("The onset of aperiodic motion", compute, draw, sized=True)
