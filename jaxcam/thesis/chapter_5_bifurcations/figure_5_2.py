"""Figure 5.2: motions along the diagram."""

import numpy as np

from ..motion_drawing import series_figure
from ..motions import Case, motion_target, WINDOW
from .figure_5_14 import A
from .figure_5_16 import D1


TARGET = motion_target(
    "Motions along the diagram",
    Case(120.0, None, 0, 1),
    Case(148.0, None, np.inf, 1),
    Case(154.1, None, 0, 0),
    Case(145.0, A, 1, 1),
    Case(152.0, D1, 2, 2),
    Case(158.0, D1, 4, 4),
    note=WINDOW,
    layout=series_figure,
)
