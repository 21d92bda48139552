"""Small recordings of known rigs, and a ball, shared by the tests of fitting."""

import dataclasses
import functools
import math

import jax.numpy as jnp
import numpy as np

from jaxcam import fitting
from jaxcam.data import DEMO_RIG
from jaxcam.data.make_demo import measure, RealRig, simulate_rig
from jaxcam.hybrid import HybridSystem
from jaxcam.recordings import read_rig, Recording, segment_case


NOMINAL = read_rig(DEMO_RIG / "rig.toml")
REAL = dataclasses.replace(RealRig(), damping=0.0)
TRUTH = {
    "stiffness": REAL.stiffness_over_inertia * NOMINAL.inertia.value,
    "spring_hook_x": REAL.spring_hook_x,
    "spring_elongation": REAL.spring_elongation,
    "spring_half_height": REAL.half_height,
    "cam_radius": REAL.height - NOMINAL.follower_half_height.value,
    "cam_eccentricity": REAL.eccentricity,
    "cam_center_x": REAL.center_x,
    "cam_center_y": REAL.center_y,
    "restitution": REAL.restitution,
}


@functools.cache
def truths():
    """Two runs of a rig without friction: with chatter, and with impacts alone."""
    return [
        simulate_rig(REAL, rpm * math.pi / 30, 2.0, settle=6.0)
        for rpm in (138.0, 158.0)
    ]


def recorded(seed: int = 0) -> list[Recording]:
    """The runs, as noisy encoders see them."""
    rng = np.random.default_rng(seed)
    sensors = NOMINAL.sensors
    runs = []
    for number, truth in enumerate(truths(), start=1):
        turned = truth.turned - 2 * np.pi * np.floor(truth.turned[0] / (2 * np.pi))
        channels = {
            "cam_angle_rad": measure(
                turned, sensors.cam_noise, sensors.cam_counts_per_turn, rng
            ),
            "follower_angle_rad": measure(
                truth.angle,
                sensors.follower_noise,
                sensors.follower_counts_per_turn,
                rng,
            ),
        }
        runs.append(Recording(f"run{number}", truth.time, channels))
    return runs


def cam_problem(runs) -> fitting.Problem:
    return fitting.Problem.build(
        fitting.cam_follower_model(NOMINAL),
        segment_case(runs, NOMINAL),
        fitting.cam_follower_parameters(NOMINAL),
    )


def assert_inside(found: fitting.Fit, most: float = 3.3) -> None:
    """No parameter is further from the truth than chance allows (1 in 1000 each)."""
    for one in found.estimates:
        off = abs(one.value - TRUTH[one.name]) / one.stderr
        assert off < most, f"{one.name} is {off:.1f} standard errors off"


class DraggedBall(HybridSystem):
    """A ball on a fixed floor with viscous drag, as a reader would write it."""

    state_names = ("height", "velocity")

    gravity: float = 9.81
    drag: float = 0.0
    restitution: float = 0.8

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.gravity - self.drag * state[1]])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])
