"""Figure 2.11: attractors of the three maps on both sides of the border collision."""

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...maps import border_collision, map_attractor, SkewMap, SquareRootMap
from ...models import CamFollower
from ...plotting.colours import FLIGHT
from ..target import Rows, Target


def _numbers(*values):
    return [jnp.asarray(value, dtype=float) for value in values]


MAPS = {
    "piecewise-linear, continuous": SkewMap(*_numbers(0.5, -1.5, 0.3)),
    "piecewise-linear, discontinuous": SkewMap(*_numbers(0.5, 0.4, 0.3, -1.0)),
    "square root": SquareRootMap(*_numbers(0.5, 0.1)),
}
"""The three maps of Figure 2.11; the parameter values are not from the thesis."""


def compute(system: CamFollower) -> Rows:
    del system
    rows: Rows = []
    skew = MAPS["piecewise-linear, continuous"]
    assert isinstance(skew, SkewMap)
    found = border_collision(skew, lambda s: s.mu, 0.2)
    rows.append(("continuous: border collision, mu", 0.0, found.parameter, ""))
    for name, mu in (("continuous", -0.3), ("continuous", 0.3)):
        period = map_attractor(SkewMap(*_numbers(skew.a, skew.b, mu))).period
        rows.append((f"{name}, mu = {mu}: period", np.nan, period, ""))
    for mu in (0.2, 0.3, 0.45, 0.6):
        period = map_attractor(SkewMap(*_numbers(0.5, 0.4, mu, -1.0))).period
        rows.append((f"discontinuous, mu = {mu}: period", np.nan, period, ""))
    root = map_attractor(SquareRootMap(*_numbers(0.5, 0.1)))
    rows.append(("square root, mu = 0.1: Lyapunov exponent", np.nan, root.lyapunov, ""))
    return rows


def draw(system: CamFollower) -> Figure:
    del system
    figure, axes = plt.subplots(1, 3, figsize=(9.6, 3.6))
    for ax, (name, chosen) in zip(axes, MAPS.items(), strict=True):
        for x in (np.linspace(-1, 0, 200), np.linspace(1e-9, 1, 200)):
            ax.plot(x, np.asarray(chosen(jnp.asarray(x))), color=FLIGHT)
        ax.plot([-1, 1], [-1, 1], color="0.7", lw=0.8)
        ax.axvline(0, color="0.7", lw=0.8, ls=":")
        ax.set_title(name.replace(", ", ",\n"), loc="left", fontsize="medium")
        ax.set_xlabel("$x_n$ (–)")
    axes[0].set_ylabel("$x_{n+1}$ (–)")
    return figure


TARGET = Target("Piecewise-smooth maps", compute, draw)
