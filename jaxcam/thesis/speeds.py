"""The speed of the cam: what picks it, and the rig at another one."""

import equinox as eqx
import jax.numpy as jnp

from ..models import CamFollower, rpm_to_rad_s


def speed_of(system):
    """The speed of the cam (rad/s), the parameter of most targets."""
    return system.speed


def at_speed(system: CamFollower, speed) -> CamFollower:
    """The rig at another speed (rad/s)."""
    return eqx.tree_at(speed_of, system, jnp.asarray(speed, dtype=jnp.float64))


def at_rpm(system: CamFollower, rpm) -> CamFollower:
    """The rig at another speed, given in rpm."""
    return at_speed(system, rpm_to_rad_s(rpm))
