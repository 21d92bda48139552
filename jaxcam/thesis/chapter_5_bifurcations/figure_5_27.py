"""Figure 5.27: corners of the lobes, computed from eq. (5.4) of the thesis with Table
5.3, and simulated.

Distances are measured from x_0, because the printed map has another offset
(docs/chatter.md).
"""

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...models import CamFollower
from ...plotting.colours import FLIGHT, IMPACT, RECORDED, SECTION
from ..target import Rows, Target
from .figure_5_25 import measured
from .table_5_3 import DELTA_X, M, X_0


def compute(system: CamFollower) -> Rows:
    lobes, _ = measured(system)
    rows = []
    for j in range(1, min(5, len(lobes.corners))):
        formula = DELTA_X * (1 - np.exp(j * M)) / (1 - np.exp(M))
        found = lobes.corners[0] - lobes.corners[j]
        rows.append((f"x_0 - x_{j}", formula, found, "rad"))
    whole = DELTA_X / (1 - np.exp(M))
    found = lobes.corners[0] - lobes.accumulation
    rows.append(("x_0 - x_inf", whole, found, "rad"))
    rows.append(("x_0", X_0, lobes.corners[0], "rad"))
    return rows


def draw(system: CamFollower) -> Figure:
    lobes, fitted = measured(system)
    figure, ax = plt.subplots(figsize=(7.6, 5.0))
    x_0, x_inf = float(fitted.x_0), float(fitted.x_inf)
    x = x_0 - 1.25 * (x_0 - x_inf) * np.linspace(0, 1, 6001) ** 3
    ax.plot(x, np.asarray(fitted(jnp.asarray(x))), color=FLIGHT)
    ax.plot(lobes.corners[:5], lobes.values[:5], "o", color=IMPACT, ms=5)
    for j in range(4):
        ax.annotate(
            rf"$(x_{j}, \Pi(x_{j}))$",
            (lobes.corners[j], lobes.values[j]),
            ((6, 4), (6, -14), (-5, -12), (-5, -12))[j],
            textcoords="offset points",
            fontsize=10,
            ha="left" if j < 2 else "right",
        )
    limit = float(fitted.alpha_inf)
    ax.axhline(limit, color=RECORDED, ls=":", lw=1)
    ax.axvline(x_inf, color=RECORDED, ls=":", lw=1)
    ax.annotate(r"$\alpha_\infty$", (x[-1], limit), (2, 5), textcoords="offset points")
    place = (3, 0.04)
    ax.annotate(
        r"$x_\infty$", (x_inf, place[1]), xycoords=("data", "axes fraction"),
        xytext=(place[0], 0), textcoords="offset points",
    )  # fmt: skip
    low = float(lobes.values[0])
    arrow = dict(arrowstyle="<->", color=SECTION, lw=0.9)
    inner = float(lobes.corners[1])
    ax.annotate("", (inner, low), (x_0, low), arrowprops=arrow)
    ax.annotate(r"$\Delta_x$", (0.5 * (inner + x_0), low), (0, -14),
                textcoords="offset points")  # fmt: skip
    ax.annotate("", (inner, low), (inner, float(lobes.values[1])), arrowprops=arrow)
    ax.annotate(r"$\Delta_\pi$", (inner, 0.5 * (low + float(lobes.values[1]))),
                (-24, -4), textcoords="offset points")  # fmt: skip
    ax.margins(x=0.09, y=0.12)
    ax.set_xlabel("x (rad)")
    ax.set_ylabel(r"$\Pi(x)$ (rad)")
    return figure


TARGET = Target("The expressions of the local map", compute, draw)
