"""Table 5.1, simulated column: speeds of the main events.

The printed rows for the route to chaos and for chaos are not distinguished here.
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
"""The events, and their printed speeds (rpm) for the rig and for the simulation."""
RIG = Events(125, 125, 155, 155, 170, 150, 188, 188, 200)
MODEL = Events(125, 125, 152, 152.6, 154.5, 135, 151, 152, 170)


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
