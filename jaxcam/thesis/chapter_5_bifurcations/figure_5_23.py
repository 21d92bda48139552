"""Figure 5.23: basins at 160.5 rpm, enlarged."""

from .basins import basins_target, NO_RINGS, Picture


TARGET = basins_target(
    "Basins at 160.5 rpm, enlarged",
    Picture(160.5, ("aperiodic",), {}, (0.3, -4.0), (0.8, 3.2)),
    note=NO_RINGS,
)
