"""Figure 2.3: cobweb diagrams of the logistic map, compared with the printed
formulas.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ... import plotting
from ...maps import iterate, LogisticMap, map_attractor
from ...models import CamFollower
from ..target import Rows, Target


COBWEBS = ((1.5, 0.8), (3.3, 0.6), (3.8, 0.1))
"""Parameters and starting point of the three cobweb diagrams."""


def compute(system: CamFollower) -> Rows:
    del system
    rows: Rows = []
    one, two, chaos = (LogisticMap(mu) for mu, _ in COBWEBS)
    end = float(iterate(one, COBWEBS[0][1], 400)[-1])
    rows.append(("mu = 1.5: fixed point (mu - 1)/mu", one.fixed_point(), end, ""))
    ends = np.sort(np.asarray(iterate(two, COBWEBS[1][1], 1000)[-2:]))
    for k, name in enumerate(("lower", "upper")):
        formula = two.period_two()[k]
        rows.append((f"mu = 3.3: {name} point of period two", formula, ends[k], ""))
    found = map_attractor(chaos, COBWEBS[2][1])
    rows.append(("mu = 3.8: Lyapunov exponent", np.nan, found.lyapunov, ""))
    return rows


def draw(system: CamFollower) -> Figure:
    del system
    figure, axes = plt.subplots(1, 3, figsize=(9.6, 3.6))
    for ax, (mu, start) in zip(axes, COBWEBS, strict=True):
        plotting.cobweb(LogisticMap(mu), start, 60, ax)
        where = dict(transform=ax.transAxes, ha="right", backgroundcolor="white")
        ax.text(0.97, 0.05, f"$\\mu = {mu}$", **where)
    return figure


TARGET = Target("Cobweb diagrams of the logistic map", compute, draw)
