"""Figure 5.14: basins at 145 rpm."""

from .basins import basins_target, Picture


A, B = (0.42092, 1.84), (0.33704, 0.13333)


TARGET = basins_target(
    "Basins at 145 rpm", Picture(145.0, ("P(inf,1)", "P(1,1)"), {"A": A, "B": B})
)
