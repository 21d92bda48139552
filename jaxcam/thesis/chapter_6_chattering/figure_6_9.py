"""Figure 6.9: the orbit at 152.67 rpm."""

from ..target import Target
from .orbit_marks import compute_marks, draw_marks


TARGET = Target("The orbit at 152.67 rpm", compute_marks, draw_marks)
