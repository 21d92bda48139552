"""Figure 4.14: permanent contact at 110 rpm, and the speed at which it ends."""

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...hybrid import simulate, Trajectory
from ...models import CamFollower, contact_load, float_speed, rad_s_to_rpm
from ...plotting.colours import CONTACT, FLIGHT
from ..speeds import at_rpm
from ..target import Rows, Target


CONTACT_SPEED, DETACHMENT = 110.0, 125.0
"""Speed of the figure, and speed of detachment in section 5.2 (rpm)."""


def constrained_run(system: CamFollower, rpm: float = CONTACT_SPEED) -> Trajectory:
    """Simulate two turns at a speed, from the orbit in permanent contact if there is
    one.
    """
    rig = at_rpm(system, rpm)
    return simulate(rig, None, 0.0, 2 * float(rig.period))


def compute(system: CamFollower) -> Rows:
    rig = at_rpm(system, CONTACT_SPEED)
    angles = np.linspace(0, 2 * np.pi, 2001)
    load = np.asarray(contact_load(rig, angles))
    lift = np.asarray(rig.contact_angle(jnp.asarray(angles)))
    run = constrained_run(system)
    return [
        ("period", 60 / CONTACT_SPEED, rig.period, "s"),
        ("impacts in two turns", 0, run.impacts.count, ""),
        ("smallest contact torque (thesis, eq. (4.10))", np.nan, load.min(), "N m"),
        ("largest contact torque (thesis, eq. (4.10))", np.nan, load.max(), "N m"),
        ("lowest contact angle", np.nan, lift.min(), "rad"),
        ("highest contact angle", np.nan, lift.max(), "rad"),
        ("detachment", DETACHMENT, rad_s_to_rpm(float_speed(rig).speed), "rpm"),
    ]


def draw(system: CamFollower) -> Figure:
    run = constrained_run(system)
    figure, ax = plt.subplots()
    times = np.linspace(float(run.t0), float(run.t1), 600)
    rig = run.system
    assert isinstance(rig, CamFollower)
    lift = np.asarray(rig.contact_angle(rig.cam_angle(jnp.asarray(times))))
    ax.plot(times, np.asarray(run.at(times))[:, 0], color=FLIGHT, label="follower")
    ax.plot(times, lift, ":", color=CONTACT, lw=2, label="contact angle")
    ax.set_xlabel("time (s)")
    ax.set_ylabel("angle (rad)")
    ax.legend()
    return figure


TARGET = Target("Permanent contact at 110 rpm", compute, draw)
