"""Figure 5.12: the orbits reached from random initial states, against speed."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ... import sweeps
from ...models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ..diagrams import draw_diagram
from ..progress import of_sweep
from ..remember import remembered
from ..target import Rows, Target


_MONTE_CARLO = 152.0, 160.0
"""Speed range of Figure 5.12 (rpm)."""
_STARTS, _MC_TURNS, _MC_KEEP = 20, 100, 50
"""Initial states per speed, cycles simulated, and cycles kept."""
_DRAWN = {"default": 161, "full": 801}
"""Number of speeds."""
BOX = (0.34, -3.0), (0.55, 3.0)
"""Box from which the initial states are drawn."""


@remembered
def drawn_diagram(system: CamFollower, size: str) -> sweeps.Diagram:
    """Compute the diagram of Figure 5.12, with new random initial states at each
    speed.
    """
    speeds = np.linspace(*_MONTE_CARLO, _DRAWN[size])
    states = sweeps.monte_carlo(*BOX, _STARTS, 0, len(speeds))
    return sweeps.diagram(
        system,
        "speed",
        rpm_to_rad_s(speeds),
        states,
        turns=_MC_TURNS,
        keep=_MC_KEEP,
        progress=of_sweep("sweeping the speed from random initial states"),
    )


def compute(system: CamFollower, size: str) -> Rows:
    made = drawn_diagram(system, size)
    speeds = np.asarray(rad_s_to_rpm(made.values))
    rows: Rows = []
    cascades = {
        "sticking orbit": ("P(inf,1)",),
        "period doublings of P(1,1)": (
            "P(2,2)",
            "P(4,4)",
            "P(8,8)",
        ),
        "P(3,3) and its period doublings": ("P(3,3)", "P(6,6)", "P(12,12)"),
    }
    met = 0
    for name, labels in cascades.items():
        where = speeds[np.any(np.isin(made.labels, labels), axis=1)]
        met += bool(len(where))
        low, high = (where.min(), where.max()) if len(where) else (np.nan, np.nan)
        rows.append((f"{name}: lowest speed", np.nan, low, "rpm"))
        rows.append((f"{name}: highest speed", np.nan, high, "rpm"))
    rows.insert(0, ("coexisting cascades", 3, met, ""))
    return rows


def draw(system: CamFollower, size: str) -> Figure:
    made = drawn_diagram(system, size)
    figure, axes = plt.subplots(2, 1, figsize=(8.4, 7.2), sharex=True)
    for k, ax in enumerate(axes):
        draw_diagram(made, ax, component=k)
        ax.label_outer()
    return figure


TARGET = Target(
    "Coexisting attractors, from random initial states", compute, draw, sized=True
)
