"""Figure 4.19: permanent contact at 120 rpm."""

from ..motions import Case, motion_target, RECORDED_NOTE


TARGET = motion_target(
    "Permanent contact at 120 rpm", Case(120.0, None, 0, 1), note=RECORDED_NOTE
)
