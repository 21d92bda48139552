"""Table 6.4: closing the loop at the interruption."""

from typing import TYPE_CHECKING

import numpy as np

from variational import composed_map

from ..models import CamFollower, rad_s_to_rpm
from ._chatter import contact_at, INTERRUPTION, interruption, pick_speed
from ._frame import frame
from ._table_6_3 import nearest_impact


if TYPE_CHECKING:
    import pandas as pd


START = (0.30697, 0.84867, 0.33665)
REMAINING = 4.201e-6
#: (6.107): velocity and time of D* by angle and velocity a turn before
A = ((0.01597, 0.00301), (-0.04830, -0.00912))
INVERSE_SCALE = 3.145e-10


def table_6_4(system: CamFollower) -> "pd.DataFrame":
    """Table 6.4 beside `system` at its interruption.

    The compensation 1/K_beta is compared with tau*^2, the factor that (6.104) lacks; D*
    is the impact where that fits best. The printed A starts a turn before at D* itself;
    here it starts at the end of the period, in flight.
    """
    rig = interruption(system)
    first = composed_map(rig, pick_speed, 0)
    release = float(first.frame.release)
    rank = nearest_impact(rig, release, -np.sqrt(INVERSE_SCALE))
    local = composed_map(rig, pick_speed, rank)
    state = contact_at(rig.prepared(), local.time, local.speed)
    # the accumulation is at release, by definition of the interruption
    matrix = np.asarray(local.matrix)
    rows = [
        ("speed", INTERRUPTION, rad_s_to_rpm(rig.speed), "rpm"),
        ("D*: angle", START[0], state[0], "rad"),
        ("D*: velocity", START[1], state[1], "rad/s"),
        ("D*: time", START[2], local.time, "s"),
        ("release less accumulation", REMAINING, 0.0, "s"),
        ("A: rebound speed by angle", A[0][0], matrix[0, 0], "1/s"),
        ("A: rebound speed by velocity", A[0][1], matrix[0, 1], ""),
        ("A: time by angle", A[1][0], matrix[1, 0], "s/rad"),
        ("A: time by velocity", A[1][1], matrix[1, 1], "s^2/rad"),
        (
            "A: by angle over by velocity",
            A[0][0] / A[0][1],
            matrix[0, 0] / matrix[0, 1],
            "1/s",
        ),
        ("1/K_beta beside tau*^2", INVERSE_SCALE, local.tau**2, "s^2"),
    ]
    return frame(rows)
