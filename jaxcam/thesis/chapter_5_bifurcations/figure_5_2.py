"""Figure 5.2: motions at six speeds of the bifurcation diagram."""

import numpy as np

from ..motion_drawing import series_figure
from ..motions import motion_target, ShownMotion, WINDOW
from .figure_5_14 import A
from .figure_5_16 import D1


TARGET = motion_target(
    "Motions along the diagram",
    ShownMotion(120.0, None, 0, 1),
    ShownMotion(148.0, None, np.inf, 1),
    ShownMotion(154.1, None, 0, 0),
    ShownMotion(145.0, A, 1, 1),
    ShownMotion(152.0, D1, 2, 2),
    ShownMotion(158.0, D1, 4, 4),
    note=WINDOW,
    layout=series_figure,
)
