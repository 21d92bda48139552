"""Figure 5.10: chaos at 154.1 rpm."""

from ..motions import Case, motion_target, WINDOW


TARGET = motion_target("Chaos at 154.1 rpm", Case(154.1, None, 0, 0), note=WINDOW)
