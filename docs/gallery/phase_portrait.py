"""The follower of a cam in the plane of angle and velocity: impacts, chatter, contact
with the cam, and release."""

import equinox as eqx
import jax.numpy as jnp

import jaxcam
from jaxcam.models import preset, rpm_to_rad_s
from jaxcam.plotting import phase_portrait


rig = eqx.tree_at(
    lambda s: s.speed, preset("calibrated"), jnp.asarray(rpm_to_rad_s(136.5))
)
turn = float(rig.period)
trajectory = jaxcam.simulate(rig, None, 0.0, 6 * turn)
figure = phase_portrait(trajectory, between=(5 * turn, 6 * turn))
