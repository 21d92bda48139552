"""Figure 5.4: P(2,2) at 152 rpm."""

from ..motions import motion_target, ShownMotion
from .figure_5_16 import D1


TARGET = motion_target("P(2,2) at 152 rpm", ShownMotion(152.0, D1, 2, 2))
