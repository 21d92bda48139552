"""Figure 5.19: motions that start at the points E and F of Figure 5.18."""

from ..motions import motion_target, ShownMotion
from .figure_5_18 import E, F1


TARGET = motion_target(
    "Motions from E and F",
    ShownMotion(154.2, E, 0, 0, "E"),
    ShownMotion(154.2, F1, 2, 2, "F1"),
)
