"""Figure 4.16, simulated part: the impacts of one turn at four speeds.

The height of a flight is its largest angle above the cam; the ratio of two successive
heights shows the loss at an impact.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...models import CamFollower, rad_s_to_rpm
from ...plotting.colours import FLIGHT
from ..releases import draw_turn, released_turn, sticking_time
from ..target import Rows, Target


BOUNCES = (135.0, 143.0, 148.0, 150.0)


def compute(system: CamFollower) -> Rows:
    rows = []
    for rpm in BOUNCES:
        run = released_turn(system, rpm)
        times = np.asarray(run.impacts.time)
        edges = np.append(float(run.t0), times[: min(3, len(times))])
        heights = []
        for start, end in zip(edges[:-1], edges[1:], strict=True):
            heights.append(float(np.max(run.gap(np.linspace(start, end, 200)[1:-1]))))
        rows.append(
            (f"{rpm:g} rpm: height of the first flight", np.nan, heights[0], "rad")
        )
        for k, height in enumerate(heights[1:]):
            name = f"{rpm:g} rpm: height of rebound {k + 1} relative to the one before"
            rows.append((name, np.nan, height / heights[k], ""))
        rows.append((f"{rpm:g} rpm: sticking time", np.nan, sticking_time(run), "s"))
    return rows


def draw(system: CamFollower) -> Figure:
    figure, axes = plt.subplots(2, 2, figsize=(8, 5), sharey=True)
    for ax, rpm in zip(axes.ravel(), BOUNCES, strict=True):
        run = released_turn(system, rpm)
        draw_turn(run, ax, f"{rpm:g} rpm", FLIGHT)
        ax.set_title(f"{rad_s_to_rpm(float(run.system.speed)):.0f} rpm", loc="left")  # pyright: ignore
        ax.label_outer()
    return figure


TARGET = Target("Rebounds at four speeds", compute, draw)
