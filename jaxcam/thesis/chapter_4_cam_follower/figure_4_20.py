"""Figure 4.20: P(inf,1) at 150 rpm."""

import numpy as np

from ..motions import motion_target, RECORDED_NOTE, ShownMotion


TARGET = motion_target(
    "P(inf,1) at 150 rpm", ShownMotion(150.0, None, np.inf, 1), note=RECORDED_NOTE
)
