"""Figure 5.7: P(inf,1) at 148 rpm."""

import numpy as np

from ..motions import motion_target, ShownMotion


TARGET = motion_target("P(inf,1) at 148 rpm", ShownMotion(148.0, None, np.inf, 1))
