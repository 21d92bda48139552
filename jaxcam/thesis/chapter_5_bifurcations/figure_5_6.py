"""Figure 5.6: permanent contact at 120 rpm."""

from ..motions import motion_target, ShownMotion


TARGET = motion_target("Permanent contact at 120 rpm", ShownMotion(120.0, None, 0, 1))
