"""Drawings of the experiment of section 4.7: both ways in one, and apart."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .. import plotting
from ..models import CamFollower
from ..plotting._style import FLIGHT, IMPACT
from ..thesis._chapter_4_experiment import experiment, UP


_AXES = {"x_label": ("speed", "rpm"), "y_label": ("angle", "rad")}


def figure_4_17(system: CamFollower, size: str) -> Figure:
    figure, ax = plt.subplots(figsize=(8.4, 4.8))
    for made in experiment(system, size):
        plotting.sweep_diagram(made, ax, x_scale=30 / np.pi, **_AXES)  # pyright: ignore
    ax.set_xlim(*UP)
    handles = [
        Line2D([], [], marker="o", ls="", color=colour, ms=5, label=word)
        for colour, word in ((FLIGHT, "forward"), (IMPACT, "backward"))
    ]
    ax.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return figure


def figure_4_18(system: CamFollower, size: str) -> Figure:
    figure, axes = plt.subplots(2, 1, figsize=(8.4, 7.2), sharex=True, sharey=True)
    words = ("(a) forward", "(b) backward")
    for ax, word, made in zip(axes, words, experiment(system, size), strict=True):
        plotting.sweep_diagram(made, ax, x_scale=30 / np.pi, **_AXES)  # pyright: ignore
        legend = ax.get_legend()
        if legend is not None:
            legend.remove()
        ax.set_title(word, loc="left")
        ax.label_outer()
    axes[0].set_xlim(*UP)
    return figure


DRAWINGS = {"figure-4.17": figure_4_17, "figure-4.18": figure_4_18}
