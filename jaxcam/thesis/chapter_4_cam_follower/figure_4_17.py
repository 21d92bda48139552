"""Figure 4.17: the events of the experiment of section 4.7.

The downward sweep ends at 150 rpm, so P(1,1) cannot be followed to a lower speed.
"""

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...models import CamFollower
from ...plotting.colours import FLIGHT, IMPACT
from ..chapter_5_bifurcations.table_5_1 import MODEL, RIG, WORDS
from ..diagrams import draw_diagram, events
from ..target import Rows, Target
from .experiment import experiment, EXPERIMENT_NOTE, UP


def compute(system: CamFollower, size: str) -> Rows:
    found = events(*experiment(system, size))
    rows = []
    for words, rig, model, value in zip(WORDS, RIG, MODEL, found, strict=True):
        rows.append((f"{words}; printed for the rig", rig, value, "rpm"))
        rows.append((f"{words}; printed for the model", model, value, "rpm"))
    return rows


def draw(system: CamFollower, size: str) -> Figure:
    figure, ax = plt.subplots(figsize=(8.4, 4.8))
    for made in experiment(system, size):
        draw_diagram(made, ax)
    ax.set_xlim(*UP)
    handles = [
        Line2D([], [], marker="o", ls="", color=colour, ms=5, label=word)
        for colour, word in ((FLIGHT, "forward"), (IMPACT, "backward"))
    ]
    ax.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return figure


TARGET = Target(
    "Events of the experiment of section 4.7, with a simulated rig",
    compute,
    draw,
    sized=True,
    note=EXPERIMENT_NOTE,
)
