"""Figure 5.20: basins at 156 rpm."""

from .basins import basins_target, Picture


G1, H1 = (0.33268, 1.656), (0.4226893, -2.552)


TARGET = basins_target(
    "Basins at 156 rpm",
    Picture(156.0, ("P(2,2)", "P(6,6)"), {"G1": G1, "H1": H1}, reruns=4),
)
