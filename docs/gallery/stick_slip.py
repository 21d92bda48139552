"""A block on a moving belt: dry friction holds the block until the spring force exceeds
the static friction, and trajectories that start inside or outside the stick-slip cycle
converge to it."""

import matplotlib.pyplot as plt
import numpy as np

import jaxcam
from jaxcam.models import BeltOscillator
from jaxcam.plotting import style
from jaxcam.plotting.colours import CONTACT, FLIGHT


block = BeltOscillator(belt=0.3, friction=1.0, weakening=2.0, damping=0.05)

with style():
    figure, ax = plt.subplots()
    for start in ([0.75, 0.05], [2.2, 0.0]):
        motion = jaxcam.simulate(block, start, 0.0, 30.0)
        times = np.linspace(0.0, 30.0, 3000)
        x, velocity = np.asarray(motion.at(times)).T
        sticks = np.abs(velocity - 0.3) < 1e-9
        ax.plot(x, velocity, color=FLIGHT, lw=1.2)
        ax.plot(x, np.where(sticks, velocity, np.nan), color=CONTACT, lw=3)
        ax.plot(*start, "o", color=FLIGHT)
    ax.annotate("sticks to the belt", (1.0, 0.3), (0.0, 6), textcoords="offset points")
    ax.set(xlabel="position (–)", ylabel="velocity (–)")
