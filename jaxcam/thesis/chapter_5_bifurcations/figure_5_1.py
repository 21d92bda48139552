"""Figure 5.1: speed range of each orbit in the upward and downward sweeps."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ... import sweeps
from ...models import CamFollower, rpm_to_rad_s
from ..diagrams import draw_diagram, label_spans
from ..progress import of_sweep
from ..remember import remembered
from ..target import Rows, Target


TURNS, KEEP = 300, 100
"""Cycles simulated and cycles kept at each speed, as given in section 5.2."""
_STEP = {"default": 0.25, "full": 0.1}
"""Speed step of Figure 5.1 (rpm)."""
_ENDS = 120.0, 170.0
"""Lowest and highest speed of Figure 5.1 (rpm)."""
_SAID = {
    (1, "contact", "to"): 125.0,
    (1, "P(inf,1)", "to"): 152.67,
    (-1, "P(1,1)", "from"): 135.946,
    (-1, "P(1,1)", "to"): 152.0,
    (-1, "P(4,4)", "from"): 157.5,
}
"""Speeds (rpm) given in the text of sections 5.2.1 and 5.2.2."""


@remembered
def both_ways(system: CamFollower, size: str) -> sweeps.Diagram:
    """Compute the diagram of Figure 5.1: upwards from contact, then downwards."""
    low, high = _ENDS
    speeds = np.linspace(low, high, round((high - low) / _STEP[size]) + 1)
    return sweeps.diagram(
        system,
        "speed",
        rpm_to_rad_s(speeds),
        direction="both",
        turns=TURNS,
        keep=KEEP,
        progress=of_sweep("sweeping the speed up and down"),
    )


def compute(system: CamFollower, size: str) -> Rows:
    made = both_ways(system, size)
    rows: Rows = []
    for way, word in ((1, "upwards"), (-1, "downwards")):
        for label in ("contact", "P(inf,1)", "P(1,1)", "P(2,2)", "P(4,4)"):
            low, high = label_spans(made, label, way)[0]
            if np.isfinite(low):
                for end, value in (("from", low), ("to", high)):
                    printed = _SAID.get((way, label, end), np.nan)
                    rows.append((f"{word}: {label} {end}", printed, value, "rpm"))
    return rows


def draw(system: CamFollower, size: str) -> Figure:
    made = both_ways(system, size)
    figure, ax = plt.subplots(figsize=(8.4, 4.8))
    draw_diagram(made, ax)
    return figure


TARGET = Target("Bifurcation diagram, up and down", compute, draw, sized=True)
