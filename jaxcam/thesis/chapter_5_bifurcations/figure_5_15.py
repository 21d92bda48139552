"""Figure 5.15: motions from A and B."""

import numpy as np

from ..motions import Case, motion_target
from .figure_5_14 import A, B


TARGET = motion_target(
    "Motions from A and B", Case(145.0, A, 1, 1, "A"), Case(145.0, B, np.inf, 1, "B")
)
