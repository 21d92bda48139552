"""Figure 6.11: impacts predicted by the lambda-map, compared with the simulated
ones.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...models import CamFollower
from ...plotting.colours import FLIGHT, IMPACT, RECORDED, SECTION
from ..target import Rows, Target
from .sequence import ChatterSequence, hops, sequence
from .table_6_2 import REBOUND_SPEED


_AHEAD = 6
"""Number of impacts predicted in Figure 6.11."""


def local_impacts(system: CamFollower) -> tuple[ChatterSequence, int]:
    """Return the sequence, and the index of the impact of Table 6.2, identified by its
    rebound speed.
    """
    found = sequence(system)
    return found, int(np.argmin(np.abs(np.log(found.speed / REBOUND_SPEED))))


def compute(system: CamFollower) -> Rows:
    found, start = local_impacts(system)
    rows: Rows = []
    count = min(_AHEAD, len(found.tau) - 1 - start)
    for k, tau in enumerate(hops(found, start, count)[1:]):
        exact = found.tau[start + k + 1]
        rows.append(
            (f"impact {k + 1} from release, map against motion", exact, tau, "s")
        )
    end = hops(found, start, 60)[-1]
    rows.append(
        ("accumulation from release, map against motion", found.accumulation, end, "s")
    )
    return rows


def draw(system: CamFollower) -> Figure:
    found, start = local_impacts(system)
    count = min(8, len(found.tau) - 1 - start)
    first, last = max(start - 5, 0), start + count
    figure, ax = plt.subplots(figsize=(7.6, 4.2))
    tau, speed = found.tau[first : last + 1], found.speed[first : last + 1]
    ax.semilogy(1e3 * tau, speed, ".-", color=FLIGHT, lw=0.9, ms=8, label="simulated")
    predicted = hops(found, start, count)
    ax.semilogy(
        1e3 * predicted,
        found.speed[start : last + 1],
        "o",
        mfc="none",
        mec=IMPACT,
        ms=11,
        label="times from the lambda-map",
    )
    ax.semilogy(1e3 * found.tau[start], found.speed[start], "*", color=SECTION, ms=12,
                label="start")  # fmt: skip
    ax.axvline(1e3 * found.accumulation, color=RECORDED, ls="--", label="accumulation")
    ax.set_xlabel("time from release (ms)")
    ax.set_ylabel("rebound speed (rad/s)")
    ax.legend()
    return figure


TARGET = Target("Impacts predicted by the local map", compute, draw)
