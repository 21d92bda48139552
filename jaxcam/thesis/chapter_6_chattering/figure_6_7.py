"""Figure 6.7: the range of the local analysis, marked on the orbit at 152.67 rpm."""

from ..target import Target
from .orbit_marks import compute_marks, draw_marks


TARGET = Target("Where the local analysis applies", compute_marks, draw_marks)
