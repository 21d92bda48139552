"""Table 5.1, simulated column: speeds of the main events.

Here, the route to chaos and chaos itself, which have separate rows in the printed
table, are treated as one range.
"""

import numpy as np

from ...models import CamFollower
from ..diagrams import Events, events, label_spans
from ..target import Rows, Target
from .figure_5_1 import both_ways


WORDS = Events(
    "permanent contact, to",
    "P(inf,1), from",
    "P(inf,1), to",
    "chatter route to chaos, from",
    "chaos, to",
    "P(1,1), from",
    "P(1,1), to",
    "P(2,2), from",
    "P(2,2) and its doublings, to",
)
"""Names of the events."""
RIG = Events(125, 125, 155, 155, 170, 150, 188, 188, 200)
"""Speeds (rpm) printed for the rig."""
MODEL = Events(125, 125, 152, 152.6, 154.5, 135, 151, 152, 170)
"""Speeds (rpm) printed for the simulation."""


def compute(system: CamFollower, size: str) -> Rows:
    made = both_ways(system, size)
    found = events(made, made)
    rows: Rows = [
        (words, printed, value, "rpm")
        for words, printed, value in zip(WORDS, MODEL, found, strict=True)
    ]
    rows.insert(1, ("detachment", MODEL.sticking_from, found.sticking_from, "rpm"))
    last = label_spans(made, "P(2,2)", -1)[0][1]
    rows.append(("P(2,2) itself, to", np.nan, last, "rpm"))
    return rows


TARGET = Target(
    "Speeds of the main events, simulated column",
    compute,
    sized=True,
    note="The computed speeds are read from the diagram of Figure 5.1 and are "
    "therefore known only to within its speed step. The printed end of P(2,2) is the "
    "end of the diagram.",
)
