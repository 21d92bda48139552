"""Table 6.4: the map of a complete cycle at the interruption.

The compensation 1/K_beta is compared with tau*^2, the factor missing in eq. (6.104) of
the thesis; D* is the impact with the best agreement. The printed matrix A starts at D*
one turn earlier; here it starts at the end of the period, in flight.
"""

import numpy as np

from variational import composed_map

from ...models import CamFollower, rad_s_to_rpm
from ..interruption import contact_at, INTERRUPTION, interruption
from ..speeds import speed_of
from ..target import Rows, Target
from .table_6_3 import nearest_impact


START = (0.30697, 0.84867, 0.33665)
REMAINING = 4.201e-6
A = ((0.01597, 0.00301), (-0.04830, -0.00912))
"""Thesis, eq. (6.107): derivatives of the velocity and time of D* with respect to the
angle and velocity one turn earlier.
"""
INVERSE_SCALE = 3.145e-10


def compute(system: CamFollower) -> Rows:
    rig = interruption(system)
    first = composed_map(rig, speed_of, 0)
    release = float(first.frame.release)
    rank = nearest_impact(rig, release, -np.sqrt(INVERSE_SCALE))
    local = composed_map(rig, speed_of, rank)
    state = contact_at(rig.prepared(), local.time, local.speed)
    # at the interruption, accumulation and release coincide by definition
    matrix = np.asarray(local.matrix)
    rows = [
        ("speed", INTERRUPTION, rad_s_to_rpm(rig.speed), "rpm"),
        ("D*: angle", START[0], state[0], "rad"),
        ("D*: velocity", START[1], state[1], "rad/s"),
        ("D*: time", START[2], local.time, "s"),
        ("release - accumulation", REMAINING, 0.0, "s"),
        ("A: d rebound speed/d angle", A[0][0], matrix[0, 0], "1/s"),
        ("A: d rebound speed/d velocity", A[0][1], matrix[0, 1], ""),
        ("A: d time/d angle", A[1][0], matrix[1, 0], "s/rad"),
        ("A: d time/d velocity", A[1][1], matrix[1, 1], "s^2/rad"),
        (
            "A: by angle over by velocity",
            A[0][0] / A[0][1],
            matrix[0, 0] / matrix[0, 1],
            "1/s",
        ),
        ("1/K_beta against tau*^2", INVERSE_SCALE, local.tau**2, "s^2"),
    ]
    return rows


TARGET = Target("The map of one cycle at the interruption", compute)
