"""Table 6.1: the end of chatter just below its interruption.

The relative coordinates of the two contact points are not compared: they are zero, and
the printed values are integration errors.
"""

import jax.numpy as jnp

from ...models import CamFollower
from ..interruption import accumulation_of, contact_at, reference, sticking_state
from ..target import Rows, Target


CHATTER_SPEED = 152.67
"""Speed of the table (rpm)."""
ACCUMULATION = (0.33474, 0.30531, 0.86956)
"""Time in the period (s), angle (rad) and velocity (rad/s) at the accumulation."""
RELEASE = (0.33668, 0.30698, 0.84854)
"""The same quantities at the release."""
SECTION_STATE = (0.33717, 0.22313)
"""Angle (rad) and velocity (rad/s) of the follower at the end of the period."""
SECTION_RELATIVE = (0.00494, 0.22315)
"""The same quantities relative to the cam."""
DECIMALS = 5
"""Decimal places in the table."""
PERIOD, STICKING = 0.39300, 0.00194
"""Period and sticking time (s)."""


def compute(system: CamFollower) -> Rows:
    rig = reference(system)
    period = float(rig.period)
    orbit = accumulation_of(rig)
    rest = float(orbit.accumulation) - period
    release = float(orbit.frame.release)
    first = contact_at(rig.prepared(), jnp.asarray(rest), jnp.zeros(()))
    last = orbit.frame.state
    state, gap, velocity = sticking_state(rig)
    rows = [
        ("accumulation: time", ACCUMULATION[0], rest, "s"),
        ("accumulation: angle", ACCUMULATION[1], first[0], "rad"),
        ("accumulation: velocity", ACCUMULATION[2], first[1], "rad/s"),
        ("release: time", RELEASE[0], release, "s"),
        ("release: angle", RELEASE[1], last[0], "rad"),
        ("release: velocity", RELEASE[2], last[1], "rad/s"),
        ("end of the period: angle", SECTION_STATE[0], state[0], "rad"),
        ("end of the period: velocity", SECTION_STATE[1], state[1], "rad/s"),
        ("end of the period: relative angle", SECTION_RELATIVE[0], gap, "rad"),
        (
            "end of the period: relative velocity",
            SECTION_RELATIVE[1],
            velocity,
            "rad/s",
        ),
        ("period", PERIOD, period, "s"),
        ("sticking time", STICKING, release - rest, "s"),
    ]
    return rows


TARGET = Target("End of chatter below its interruption", compute)
