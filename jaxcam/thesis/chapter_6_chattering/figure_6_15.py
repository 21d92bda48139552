"""Figure 6.15: predicted and simulated state at the section after a change of speed.

Below the interruption the motion depends on the speed only through the release; the
slopes are those of Table 6.3, here computed from simulations.
"""

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from variational.chatter import simulated_by_parameter

from ...models import CamFollower, rpm_to_rad_s
from ..remember import remembered
from ..speeds import speed_of
from ..target import Rows, Target
from .rebuilt import composed_at, draw_rebuilt, error_of, Rebuilt
from .table_6_3 import ANGLE, VELOCITY


_CHANGE = 0.001 * 152.67
"""Largest change of speed in Figure 6.15 (rpm)."""


@remembered
def rebuilt_parameter(system: CamFollower) -> Rebuilt:
    """Compute the data of Figure 6.15, in which the cam speed (rpm) is changed."""
    rig, composed = composed_at(system, late=True)
    change = np.linspace(-_CHANGE, _CHANGE, 401)
    rates = jnp.asarray(rpm_to_rad_s(change))
    predicted = np.asarray(composed.along_parameter(rates))
    section = simulated_by_parameter(rig, speed_of, rates)
    simulated = np.stack([np.asarray(section.gap), np.asarray(section.velocity)], 1)
    return Rebuilt(change, predicted, simulated, composed)


def compute(system: CamFollower) -> Rows:
    found = rebuilt_parameter(system)
    below = found.deviations < -0.02
    angle, velocity = (
        np.polyfit(found.deviations[below], found.simulated[below, k], 1)[0]
        for k in (0, 1)
    )
    return [
        (
            "derivative of the velocity at the section with respect to speed",
            VELOCITY,
            velocity,
            "rad/s/rpm",
        ),
        (
            "derivative of the angle at the section with respect to speed",
            ANGLE,
            angle,
            "rad/rpm",
        ),
        ("median error over the range of the velocity", np.nan, error_of(found), ""),
    ]


def draw(system: CamFollower) -> Figure:
    return draw_rebuilt(rebuilt_parameter(system), "change of speed (rpm)")


TARGET = Target("Section after a change of speed", compute, draw)
