"""Figure 5.15: motions from A and B."""

import numpy as np

from ..motions import motion_target, ShownMotion
from .figure_5_14 import A, B


TARGET = motion_target(
    "Motions from A and B",
    ShownMotion(145.0, A, 1, 1, "A"),
    ShownMotion(145.0, B, np.inf, 1, "B"),
)
