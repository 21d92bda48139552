"""Table 6.3: derivatives of the local map with respect to the cam speed.

The thesis estimates them from perturbed simulations. The derivative of lambda is given
twice: with D* fixed, and with D* moving with the orbit.
"""

import numpy as np

from variational import composed_map

from ...models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ..interruption import impacts_from_release, interruption, REFERENCE
from ..speeds import speed_of
from ..target import Rows, Target


BY_SPEED, VELOCITY, ANGLE = 3.9, 0.009647, 0.0002305
D_STAR = -0.00194
"""Time of D* from release (Table 6.1)."""


def nearest_impact(rig: CamFollower, release: float, tau: float) -> int:
    """Return the index of the impact whose time relative to the next release is closest
    to `tau` on a logarithmic scale.
    """
    impacts = impacts_from_release(rig, 40)
    found = np.asarray(impacts.time) - release - float(rig.period)
    usable = np.asarray(impacts.found) & (found < 0)
    ratio = np.where(
        usable, np.abs(np.log(np.where(usable, found, -1.0) / tau)), np.inf
    )
    return int(np.argmin(ratio))


def compute(system: CamFollower) -> Rows:
    rig = interruption(system)
    first = composed_map(rig, speed_of, 0)
    rank = nearest_impact(rig, float(first.frame.release), D_STAR)
    local = composed_map(rig, speed_of, rank)
    rpm = float(rpm_to_rad_s(1.0))
    gap, velocity = np.asarray(local.drift) * rpm
    held, moving = float(local.by_parameter) * rpm, float(local.incidence) * rpm
    return [
        ("speed", REFERENCE, rad_s_to_rpm(rig.speed), "rpm"),
        ("d lambda/d speed, D* fixed", BY_SPEED, held, "1/rpm"),
        ("d lambda/d speed, D* moving", BY_SPEED, moving, "1/rpm"),
        ("d Gamma/d speed", VELOCITY, velocity, "rad/s/rpm"),
        ("d Omega/d speed", ANGLE, gap, "rad/rpm"),
    ]


TARGET = Target("The effect of the cam speed on the local map", compute)
