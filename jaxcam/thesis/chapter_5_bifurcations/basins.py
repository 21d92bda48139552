"""Basins of attraction at a printed speed, Figures 5.14 to 5.23."""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ... import plotting, sweeps
from ...models import CamFollower
from ..progress import of_sweep
from ..remember import remembered
from ..speeds import at_rpm
from ..target import Rows, Target


_BOX = (0.33, -3.5), (0.6, 3.5)
"""Default corners of the state grid."""
_SHAPE = {"default": 128, "full": 400}
_TURNS, _KEEP, _RERUNS = 100, 48, 2


NO_RINGS = (
    "The printed figure, made by cell mapping, shows rings; in simulations that last "
    "until the steady state, all motions reach one chaotic attractor."
)


class Picture(NamedTuple):
    """A figure of basins: its speed, labels and printed points."""

    rpm: float
    labels: tuple[str, ...]
    """Printed labels of its attractors; chaos is "aperiodic"."""
    points: dict[str, tuple[float, float]]
    low: tuple[float, float] = _BOX[0]
    """Lower corner of the state grid."""
    high: tuple[float, float] = _BOX[1]
    """Upper corner of the state grid."""
    reruns: int = _RERUNS
    """Number of times that a non-periodic motion is extended; each time, its length is
    doubled.
    """


def basins_target(title: str, picture: Picture, note: str = "") -> Target:
    """Create the target of a figure of basins, with computed and printed attractors."""

    @remembered
    def basins_of(system: CamFollower, size: str) -> sweeps.Basins:
        count = _SHAPE[size]
        return sweeps.basins(
            at_rpm(system, picture.rpm),
            sweeps.Grid(picture.low, picture.high, (count, count)),
            _TURNS,
            keep=_KEEP,
            reruns=picture.reruns,
            progress=of_sweep("simulating the grid of states"),
        )

    def compute(system: CamFollower, size: str) -> Rows:
        found = basins_of(system, size)
        rows: Rows = []
        for label in picture.labels:
            own = [name for name in found.names if name.split(" ")[0] == label]
            rows.append((f"attractors {label}", 1, len(own), ""))
        for name, share in found.shares.items():
            rows.append((f"fraction of the states: {name}", np.nan, share.share, ""))
        return rows

    def draw(system: CamFollower, size: str) -> Figure:
        return _draw(basins_of(system, size), picture)

    return Target(title, compute, draw, sized=True, note=note)


def _draw(found: sweeps.Basins, picture: Picture) -> Figure:
    """Draw the basins, and the printed points with their letters."""
    figure, ax = plt.subplots(figsize=(7.2, 5.4))
    plotting.basin_picture(found, ax)
    for name, (x, y) in picture.points.items():
        ax.plot(x, y, "+", color="k", ms=11, mew=4.5)
        ax.plot(x, y, "+", color="w", ms=9, mew=2)
        box = dict(boxstyle="round,pad=0.15", fc="white", ec="0.3", lw=0.6)
        ax.annotate(
            name, (x, y), (7, 7), textcoords="offset points", bbox=box, fontsize=11
        )
    ax.set_xlabel("angle (rad)")
    ax.set_ylabel("velocity (rad/s)")
    return figure
