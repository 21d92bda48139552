"""Figure 2.7: attracting branches on either side of the bifurcation of each normal
form.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...maps.normal_forms import NORMAL_FORMS
from ...models import CamFollower
from ...plotting.colours import FLIGHT
from ..target import Rows, Target


def compute(system: CamFollower) -> Rows:
    del system
    expected = {
        "fold": (0, 1),
        "transcritical": (1, 1),
        "pitchfork": (1, 2),
        "hopf": (1, 1),
        "period-doubling": (1, 2),
    }
    rows: Rows = []
    for name, form in NORMAL_FORMS.items():
        for mu, printed in zip((-0.2, 0.2), expected[name], strict=True):
            found = sum(bool(form.stable(k, mu)[0]) for k in range(len(form.branches)))
            title = f"{form.title}: attracting branches at mu = {mu}"
            rows.append((title, printed, found, ""))
    return rows


def draw(system: CamFollower) -> Figure:
    del system
    figure, axes = plt.subplots(1, 5, figsize=(12, 3), sharey=True)
    mu = np.linspace(-1, 1, 401)
    for ax, form in zip(axes, NORMAL_FORMS.values(), strict=True):
        for k, branch in enumerate(form.branches):
            x, stable = branch(mu), form.stable(k, mu)
            ax.plot(mu, np.where(stable, x, np.nan), color=FLIGHT, lw=1.8)
            ax.plot(mu, np.where(stable, np.nan, x), "--", color=FLIGHT, lw=0.9)
        ax.set_title(form.title, loc="left")
        ax.set_xlabel(r"$\mu$")
    axes[0].set_ylabel("x, or radius (–)")
    return figure


TARGET = Target("Normal forms of codimension one", compute, draw)
