"""Figure 5.5: P(4,4) at 158 rpm."""

from ..motions import motion_target, ShownMotion
from .figure_5_16 import D1


TARGET = motion_target("P(4,4) at 158 rpm", ShownMotion(158.0, D1, 4, 4))
