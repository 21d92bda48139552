"""Figure 2.4 and eq. (2.17) of the thesis: the Feigenbaum ratio of the period-doubling
cascade.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...maps import feigenbaum_ratios, LogisticMap, map_diagram, superstable
from ...models import CamFollower
from ...plotting.colours import FLIGHT
from ..target import Rows, Target


FEIGENBAUM = 4.669
"""Feigenbaum ratio as printed in eq. (2.17) of the thesis."""


def compute(system: CamFollower) -> Rows:
    del system
    values = superstable(LogisticMap(), lambda s: s.mu, 0.5, (2.0, 3.24), 12)
    ratios = feigenbaum_ratios(values)
    tail = (values[-1] - values[-2]) / (ratios[-1] - 1)
    rows = [(f"ratio {k + 1}", FEIGENBAUM, r, "") for k, r in enumerate(ratios)]
    rows.append(("end of the cascade", np.nan, values[-1] + tail, ""))
    return rows


def draw(system: CamFollower) -> Figure:
    del system
    figure, ax = plt.subplots()
    values = np.linspace(2.6, 4.0, 1200)
    points = np.asarray(map_diagram(LogisticMap(), lambda s: s.mu, values, keep=150))
    ax.plot(np.repeat(values, 150), points.ravel(), ",", color=FLIGHT, alpha=0.4)
    ax.set_xlabel(r"$\mu$")
    ax.set_ylabel("x (–)")
    return figure


TARGET = Target("The period-doubling cascade", compute, draw)
