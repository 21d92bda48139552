"""Figure 5.10: chaos at 154.1 rpm."""

from ..motions import motion_target, ShownMotion, WINDOW


TARGET = motion_target(
    "Chaos at 154.1 rpm", ShownMotion(154.1, None, 0, 0), note=WINDOW
)
