"""The rig at the interruption of complete chattering, for the tables of chapter 6."""

import equinox as eqx
import jax.numpy as jnp

from variational import (
    chatter_accumulation,
    chatter_frame,
    chatter_interruption,
    fly,
    release_impacts,
    surface_state,
)

from ..models import CamFollower, rpm_to_rad_s


#: where the thesis' rig is interrupted (section 6.7.1), and where Table 6.1 is taken
INTERRUPTION = 152.67658
REFERENCE = 152.67
#: rpm either side of it in which the interruption of another rig is looked for
_AROUND = 6.0


def pick_speed(system: CamFollower):
    """The speed of the cam, the parameter of chapter 6."""
    return system.speed


def at_speed(system: CamFollower, speed) -> CamFollower:
    """The rig at another speed (rad/s)."""
    return eqx.tree_at(pick_speed, system, jnp.asarray(speed, dtype=jnp.float64))


def interruption(system: CamFollower) -> CamFollower:
    """The rig at the speed where its complete chattering is interrupted.

    **Raises:** `ValueError` where that is not within 6 rpm of the thesis' speed.
    """
    low, high = INTERRUPTION - _AROUND, INTERRUPTION + _AROUND
    bracket = (float(rpm_to_rad_s(low)), float(rpm_to_rad_s(high)))
    return at_speed(system, chatter_interruption(system, pick_speed, bracket))


def reference(system: CamFollower) -> CamFollower:
    """The rig as far below its interruption as Table 6.1 is below the thesis' own.

    Close to the interruption everything that chatters depends on that distance.
    """
    below = float(rpm_to_rad_s(INTERRUPTION - REFERENCE))
    return at_speed(system, pick_speed(interruption(system)) - below)


impacts_from_release = eqx.filter_jit(release_impacts)
accumulation_of = eqx.filter_jit(chatter_accumulation)
contact_at = eqx.filter_jit(surface_state)


@eqx.filter_jit
def sticking_state(system: CamFollower):
    """State, gap and relative velocity at the end of the period of a sticking orbit."""
    system = system.prepared()
    release = chatter_frame(system)
    left = system.period - release.release
    return fly(system, release.release, release.state, jnp.zeros(()), left)
