"""Figure 5.3: P(1,1) at 145 rpm."""

from ..motions import motion_target, ShownMotion
from .figure_5_14 import A


TARGET = motion_target("P(1,1) at 145 rpm", ShownMotion(145.0, A, 1, 1))
