"""Figure 4.18: data from the experiment of section 4.7, forward and backward.

The printed values are those of section 4.7.1 for the upward sweep. In the downward
sweep the model, whose follower can rise without limit, has orbits that no real rig
could follow, as the largest sampled angle shows.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...models import CamFollower, rad_s_to_rpm
from ..diagrams import draw_diagram
from ..target import Rows, Target
from .experiment import DWELL, experiment, EXPERIMENT_NOTE, UP


_WIDE = 1.0 - 1e-9
"""Smallest speed range (rpm) for which a label is listed."""


def compute(system: CamFollower, size: str) -> Rows:
    rows: Rows = []
    said = {
        ("forward", "contact", "to"): 125.0,
        ("forward", "P(inf,1)", "from"): 125.0,
        ("forward", "P(inf,1)", "to"): 155.0,
    }
    ways = ("forward", "backward")
    for way, made in zip(ways, experiment(system, size), strict=True):
        stored = np.isfinite(made.states[:, 0, :, 0]).sum(axis=1)
        turn = 2 * np.pi / made.values
        rows += [
            (f"{way}: speeds", np.nan, len(made.values), ""),
            (
                f"{way}: shortest time stored at a speed",
                DWELL[1],
                np.min(stored * turn),
                "s",
            ),
            (f"{way}: samples", np.nan, stored.sum(), ""),
        ]
        angles = made.states[:, 0, :, 0]
        for found in sorted(made.ranges(), key=lambda r: r.low):
            low, high = rad_s_to_rpm(found.low), rad_s_to_rpm(found.high)
            if high - low < _WIDE:
                continue
            words = f"{way}: {found.label}"
            for end, value in (("from", low), ("to", high)):
                printed = said.get((way, found.label, end), np.nan)
                rows.append((f"{words}, {end}", printed, value, "rpm"))
            some = (made.values >= found.low) & (made.values <= found.high)
            rows.append(
                (f"{words}, largest angle", np.nan, np.nanmax(angles[some]), "rad")
            )
    return rows


def draw(system: CamFollower, size: str) -> Figure:
    figure, axes = plt.subplots(2, 1, figsize=(8.4, 7.2), sharex=True, sharey=True)
    words = ("(a) forward", "(b) backward")
    for ax, word, made in zip(axes, words, experiment(system, size), strict=True):
        draw_diagram(made, ax)
        legend = ax.get_legend()
        if legend is not None:
            legend.remove()
        ax.set_title(word, loc="left")
        ax.label_outer()
    axes[0].set_xlim(*UP)
    return figure


TARGET = Target(
    "The experiment of section 4.7, forward and backward",
    compute,
    draw,
    sized=True,
    note=EXPERIMENT_NOTE,
)
