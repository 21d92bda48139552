"""Figure 5.15: motions that start at the points A and B of Figure 5.14."""

import numpy as np

from ..motions import motion_target, ShownMotion
from .figure_5_14 import A, B


TARGET = motion_target(
    "Motions from A and B",
    ShownMotion(145.0, A, 1, 1, "A"),
    ShownMotion(145.0, B, np.inf, 1, "B"),
)
