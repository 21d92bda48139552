"""Figure 6.6: ratio of successive impact times tau, by h(lambda) and simulated."""

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational.chatter import hop_ratio

from ...models import CamFollower
from ...plotting.colours import FLIGHT, IMPACT, SECTION
from ...plotting.curves import trajectory_curve
from ..target import Rows, Target
from .sequence import sequence, sticking_turn


def compute(system: CamFollower) -> Rows:
    found = sequence(system)
    rows: Rows = []
    for k in range(min(len(found.tau) - 1, 12)):
        lam = found.speed[k] / (found.frame.jerk * found.tau[k] ** 2)
        if lam > 1 / 3:
            continue
        rows.append(
            (
                f"tau of impact {k + 2} relative to impact {k + 1}, h against exact",
                hop_ratio(jnp.asarray(lam)),
                found.tau[k + 1] / found.tau[k],
                "",
            )
        )
    return rows


def draw(system: CamFollower) -> Figure:
    found = sequence(system)
    run = sticking_turn(system)
    figure, ax = plt.subplots(figsize=(8.4, 4.4))
    drawn = trajectory_curve(run, None, 6000)
    release = float(found.frame.release) % float(found.system.period)
    ax.plot(drawn.time - release, 1e3 * drawn.gap[:, 0], color=FLIGHT, lw=1.3)
    tau = found.tau[:12]
    ax.plot(tau, np.zeros_like(tau), ".", color=IMPACT, ms=7)
    for k, place in enumerate(tau[:9]):
        ax.annotate(
            f"{k + 1}", (place, 0), (0, -13), textcoords="offset points",
            ha="center", fontsize=10,
        )  # fmt: skip
    ax.axvline(0, color=SECTION, ls=":", lw=1)
    ax.set_xlim(tau[0] - 0.01, 0.02)
    inside = (drawn.time - release > tau[0]) & (drawn.time < release)
    top = 1e3 * np.nanmax(drawn.gap[inside])
    ax.set_ylim(-0.12 * top, 1.15 * top)
    ax.set_xlabel("time from release (s)")
    ax.set_ylabel("gap (mrad)")
    return figure


TARGET = Target("Impacts of a chatter sequence", compute, draw)
