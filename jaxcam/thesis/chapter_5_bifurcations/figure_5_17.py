"""Figure 5.17: motions that start at the points C and D of Figure 5.16."""

import numpy as np

from ..motions import motion_target, ShownMotion
from .figure_5_16 import C, D1, D2


TARGET = motion_target(
    "Motions from C and D",
    ShownMotion(152.3, C, np.inf, 1, "C"),
    ShownMotion(152.3, D1, 2, 2, "D1"),
    ShownMotion(152.3, D2, 2, 2, "D2"),
)
