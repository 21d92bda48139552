"""Infinitely many impacts in finite time: each step of the staircase is an impact, and
the steps accumulate at the time at which the ball comes to rest."""

import matplotlib.pyplot as plt
import numpy as np

import jaxcam
from jaxcam.models import BouncingBall
from jaxcam.plotting import style
from jaxcam.plotting.colours import CONTACT, FLIGHT, IMPACT


ball = BouncingBall(gravity=9.81, restitution=0.8)
trajectory = jaxcam.simulate(ball, [0.3, 0.0], 0.0, 2.8)

hits = trajectory.impacts.time[: trajectory.impacts.count]
rest = float(trajectory.contacts.start[0])
times = np.linspace(0.0, 2.8, 2000)

with style():
    figure, (top, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 5.0))
    top.plot(times, trajectory.at(times)[:, 0], color=FLIGHT)
    top.set_ylabel("height (m)")
    below.step(hits, np.arange(1, len(hits) + 1), where="post", color=IMPACT)
    below.set(xlabel="time (s)", ylabel="number of impacts (–)")
    for ax in (top, below):
        ax.axvspan(rest, 2.8, color=CONTACT, alpha=0.3, lw=0)
    top.text(rest, 0.28, " at rest", va="top")
    below.text(rest, 55, f"accumulation point: {rest:.4f} s  ", ha="right")
