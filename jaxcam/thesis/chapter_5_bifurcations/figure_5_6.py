"""Figure 5.6: permanent contact at 120 rpm."""

from ..motions import Case, motion_target


TARGET = motion_target("Permanent contact at 120 rpm", Case(120.0, None, 0, 1))
