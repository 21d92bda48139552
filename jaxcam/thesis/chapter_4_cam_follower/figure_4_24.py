"""Figure 4.24: P(2,2) at 188 rpm."""

from ..chapter_5_bifurcations.figure_5_14 import A
from ..motions import motion_target, RECORDED_NOTE, ShownMotion


TARGET = motion_target(
    "P(2,2) at 188 rpm", ShownMotion(188.0, A, 2, 2), note=RECORDED_NOTE
)
