"""Figure 5.7: P(inf,1) at 148 rpm."""

import numpy as np

from ..motions import Case, motion_target


TARGET = motion_target("P(inf,1) at 148 rpm", Case(148.0, None, np.inf, 1))
