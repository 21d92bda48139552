"""Figure 4.19: permanent contact at 120 rpm."""

from ..motions import motion_target, RECORDED_NOTE, ShownMotion


TARGET = motion_target(
    "Permanent contact at 120 rpm", ShownMotion(120.0, None, 0, 1), note=RECORDED_NOTE
)
