"""Figure 4.21: interruption of chatter."""

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
