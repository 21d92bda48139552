"""Figure 5.3: P(1,1) at 145 rpm."""

from ..motions import Case, motion_target
from .figure_5_14 import A


TARGET = motion_target("P(1,1) at 145 rpm", Case(145.0, A, 1, 1))
