"""Figure 5.16: basins at 152.3 rpm."""

from .basins import basins_target, Picture


C, D1, D2 = (0.33704, 0.24), (0.37253, 1.7867), (0.430593, 1.9466)


TARGET = basins_target(
    "Basins at 152.3 rpm",
    Picture(152.3, ("P(inf,1)", "P(2,2)"), {"C": C, "D1": D1, "D2": D2}),
)
