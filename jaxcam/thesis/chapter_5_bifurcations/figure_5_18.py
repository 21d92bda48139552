"""Figure 5.18: basins at 154.2 rpm."""

from ..motions import WINDOW
from .basins import basins_target, Picture


E, F1 = (0.36365, 0.008), (0.34623, 1.704)


TARGET = basins_target(
    "Basins at 154.2 rpm",
    Picture(154.2, ("aperiodic", "P(2,2)"), {"E": E, "F1": F1}),
    note=WINDOW,
)
