"""Figure 5.21: motions that start at the points G and H of Figure 5.20."""

from ..motions import motion_target, ShownMotion
from .figure_5_20 import G1, H1


TARGET = motion_target(
    "Motions from G and H",
    ShownMotion(156.0, G1, 2, 2, "G1"),
    ShownMotion(156.0, H1, 6, 6, "H1"),
)
