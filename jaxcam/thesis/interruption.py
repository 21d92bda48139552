"""Find the interruption of complete chatter of the rig."""

import jax.numpy as jnp
import numpy as np

from variational import chatter_accumulation, chatter_frame
from variational.chatter import fly, interruption_in, release_impacts, surface_state

from ..hybrid.programs import program
from ..models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from .progress import counted
from .remember import remembered
from .speeds import at_speed, speed_of


INTERRUPTION = 152.67658
"""Speed of the interruption for the rig of the thesis (rpm, section 6.7.1)."""
REFERENCE = 152.67
"""Speed of Table 6.1 (rpm)."""
_RANGE, _RANGES = 12.0, 5
"""Width of the search ranges (rpm), and number of further ranges on either side of the
speed in the thesis.
"""
_MOVED = 0.01
"""Resolution (rpm) of the shift of printed speeds to another rig's interruption."""


@remembered
def interruption(system: CamFollower) -> CamFollower:
    """Return the rig at the speed of the interruption of its complete chatter.

    Raises:
        ValueError: The interruption is not within 66 rpm of the speed in the thesis.
    """
    places = [0, *(way * k for k in range(1, _RANGES + 1) for way in (1, -1))]
    for place in counted("searching a range of speeds for the interruption", places):
        middle = INTERRUPTION + _RANGE * place
        ends = np.array([middle - _RANGE / 2, middle + _RANGE / 2])
        low, high = np.asarray(rpm_to_rad_s(ends))
        found = _search(system, low, high)
        # chatter must be complete below the speed found, and incomplete above it; at
        # detachment, it is the other way round
        if bool(found.converged) and found.ends[0] < 0 < found.ends[1]:
            return at_speed(system, found.value)
    far = _RANGE * (_RANGES + 0.5)
    raise ValueError(
        "This rig has no interruption of chatter between "
        f"{INTERRUPTION - far:.0f} and {INTERRUPTION + far:.0f} rpm, which the "
        "theory near an interruption requires."
    )


@program
def _search(system, low, high):
    return interruption_in(system, speed_of, low, high)


def beside_interruption(system: CamFollower, rpm: float) -> float:
    """Return a speed (rpm) as far from the interruption of a rig as a printed speed is
    from that of the thesis.

    The shift is rounded to 0.01 rpm, so that printed speeds are unchanged for the rig
    of the thesis.
    """
    own = float(rad_s_to_rpm(interruption(system).speed))
    moved = round((own - INTERRUPTION) / _MOVED) * _MOVED
    return round(rpm + moved, 6)


def reference(system: CamFollower) -> CamFollower:
    """Return the rig at a speed as far below its interruption as that of Table 6.1.

    Close to the interruption, chatter depends only on the distance from it.
    """
    below = float(rpm_to_rad_s(INTERRUPTION - REFERENCE))
    return at_speed(system, speed_of(interruption(system)) - below)


impacts_from_release = program(release_impacts)
accumulation_of = program(chatter_accumulation)
contact_at = program(surface_state)


@program
def sticking_state(system: CamFollower):
    """Return the state, gap and relative velocity of a sticking orbit at the end of its
    period.
    """
    system = system.prepared()
    release = chatter_frame(system)
    left = system.period - release.release
    return fly(system, release.release, release.state, jnp.zeros(()), left)
