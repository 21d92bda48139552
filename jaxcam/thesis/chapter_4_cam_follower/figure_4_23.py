"""Figure 4.23: P(1,1) at 165 rpm."""

from ..chapter_5_bifurcations.figure_5_14 import A
from ..motions import motion_target, RECORDED_NOTE, ShownMotion


TARGET = motion_target(
    "P(1,1) at 165 rpm", ShownMotion(165.0, A, 1, 1), note=RECORDED_NOTE
)
