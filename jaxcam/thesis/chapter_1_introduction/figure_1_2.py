"""Figure 1.2: impacts and sticking of the orbit with complete chatter at 152.65 rpm."""

import numpy as np
from matplotlib.figure import Figure

from ... import plotting
from ...models import CamFollower
from ..releases import released_turn, sticking_time
from ..target import Rows, Target
from .figure_1_3 import both_sides


def compute(system: CamFollower) -> Rows:
    complete = both_sides(system)[0]
    run = released_turn(system, complete)
    speeds = -np.asarray(run.impacts.speed_before)
    return [
        ("impacts resolved before chatter is completed", np.nan, len(speeds), ""),
        ("fastest impact", np.nan, np.max(speeds), "rad/s"),
        (
            "ratio of slowest to fastest impact",
            np.nan,
            np.min(speeds) / np.max(speeds),
            "",
        ),
        ("sticking time", np.nan, sticking_time(run), "s"),
        ("period", 60 / complete, run.system.period, "s"),
    ]


def draw(system: CamFollower) -> Figure:
    run = released_turn(system, both_sides(system)[0])
    return plotting.phase_portrait(run)


TARGET = Target("A periodic orbit with chatter", compute, draw)
