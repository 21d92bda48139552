"""The follower of a cam at 140 rpm: it leaves the cam, chatters, and stays in contact
until the next cycle."""

import equinox as eqx
import jax.numpy as jnp

import jaxcam
from jaxcam.models import preset, rpm_to_rad_s
from jaxcam.plotting import time_history


rig = eqx.tree_at(
    lambda s: s.speed, preset("calibrated"), jnp.asarray(rpm_to_rad_s(140.0))
)
turn = float(rig.period)
trajectory = jaxcam.simulate(rig, None, 0.0, 6 * turn)
figure = time_history(trajectory, components=[0], between=(4 * turn, 6 * turn))
