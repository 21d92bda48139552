"""Table 6.1: where chattering ends just below its interruption."""

from typing import TYPE_CHECKING

import jax.numpy as jnp

from ..models import CamFollower
from ._chatter import accumulation_of, contact_at, reference, sticking_state
from ._frame import frame
from ._printed import ACCUMULATION, RELEASE, SECTION, SECTION_RELATIVE


if TYPE_CHECKING:
    import pandas as pd


PERIOD, STICKING = 0.39300, 0.00194


def table_6_1(system: CamFollower) -> "pd.DataFrame":
    """Table 6.1 beside `system`, as far below its own interruption.

    The relative coordinates of the two contact points are not compared: they are zero,
    and what is printed for them is the thesis' integration error.
    """
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
        ("end of the period: angle", SECTION[0], state[0], "rad"),
        ("end of the period: velocity", SECTION[1], state[1], "rad/s"),
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
    return frame(rows)
