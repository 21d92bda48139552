"""Figure 4.21: the interruption of chatter, in cycles at 155, 158 and 160 rpm."""

import numpy as np

from ..motions import RECORDED_NOTE
from ..releases import released_target


TARGET = released_target(
    "Interruption of chatter",
    (155.0, 1),
    (158.0, np.nan),
    (160.0, 0),
    note=RECORDED_NOTE,
)
