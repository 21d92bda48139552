"""Figure 5.19: motions from E and F."""

from ..motions import Case, motion_target
from .figure_5_18 import E, F1


TARGET = motion_target(
    "Motions from E and F", Case(154.2, E, 0, 0, "E"), Case(154.2, F1, 2, 2, "F1")
)
