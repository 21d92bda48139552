"""Figure 4.22: chaos at 165 rpm."""

from ..motions import motion_target, RECORDED_NOTE, ShownMotion


TARGET = motion_target(
    "Chaos at 165 rpm", ShownMotion(165.0, None, 0, 0), note=RECORDED_NOTE
)
