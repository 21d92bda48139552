"""Get and set the cam speed of a model."""

import equinox as eqx
import jax.numpy as jnp

from ..models import CamFollower, rpm_to_rad_s


def speed_of(system):
    """Return the cam speed (rad/s), the parameter in most targets."""
    return system.speed


def at_speed(system: CamFollower, speed) -> CamFollower:
    """Return the model at another speed (rad/s)."""
    return eqx.tree_at(speed_of, system, jnp.asarray(speed, dtype=jnp.float64))


def at_rpm(system: CamFollower, rpm) -> CamFollower:
    """Return the model at another speed, given in rpm."""
    return at_speed(system, rpm_to_rad_s(rpm))
