"""The contact force between a valve and its cam at three speeds: where the force would
have to be tensile, the spring is too weak and the valve floats."""

import equinox as eqx
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from jaxcam.models import contact_load, float_speed, MotionProgram, Segment, ValveTrain
from jaxcam.plotting import style
from jaxcam.plotting.colours import IMPACT


quarter = np.pi / 2
cam = MotionProgram(
    [
        Segment("dwell", quarter),
        Segment("cycloidal", quarter, 0.010),
        Segment("dwell", quarter),
        Segment("cycloidal", quarter, -0.010),
    ]
)
valve = ValveTrain(cam, speed=150.0, mass=0.2, stiffness=30e3, preload=250.0)
limit = float(float_speed(valve).speed)
angles = np.linspace(0, 2 * np.pi, 721)

with style():
    figure, ax = plt.subplots()
    for share in (0.7, 1.0, 1.3):
        moved = eqx.tree_at(lambda s: s.speed, valve, jnp.asarray(share * limit))
        force = np.asarray(contact_load(moved, angles))
        label = f"{moved.speed * 30 / np.pi:.0f} rpm"
        ax.plot(np.rad2deg(angles), force, label=label)
        pulls = np.rad2deg(angles), force, 0, force < 0
        ax.fill_between(*pulls, color=IMPACT, alpha=0.3)
    ax.axhline(0, color="0.3", lw=0.8)
    ax.margins(y=0.12)
    ax.set(xlabel="cam angle (degrees)", ylabel="contact force (N)", xlim=(0, 360))
    ax.set_xticks(np.arange(0, 361, 45))
    ax.legend(loc="upper center")
