"""Figure 5.22: basins at 160.5 rpm."""

from .basins import basins_target, NO_RINGS, Picture


TARGET = basins_target(
    "Basins at 160.5 rpm",
    Picture(160.5, ("aperiodic",), {}, (0.3, -10.0), (1.2, 10.0)),
    note=NO_RINGS,
)
