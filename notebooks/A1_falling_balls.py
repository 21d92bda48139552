# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # A1. Falling balls
#
# Balls were dropped from a bridge and filmed at 15 Hz, each of them twice (de Silva et
# al. 2020, MIT licence). Textbooks say that they all fall alike. Do they?
#
# The recordings are not part of the package. The folder is named by the environment
# variable `JAXCAM_RECORDINGS`; without it this notebook says so and stops.

# +
import os
import sys
from pathlib import Path

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import jaxcam
from jaxcam.recordings import read_case


root = Path(os.environ.get("JAXCAM_RECORDINGS", "../shared/recordings"))
folder = root / "real" / "ball_drop"
if not folder.is_dir():
    print(f"Skipped: there is no folder {folder}; set JAXCAM_RECORDINGS.")
    sys.exit()
# -

# ## A falling body, in ten lines


class FallingBody(jaxcam.HybridSystem):
    """Free fall above the water; state height (m) and velocity (m/s)."""

    gravity: float = 9.81
    restitution: float = 0.0

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.gravity])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


# ## What each drop leaves over
#
# The start of each drop, height and velocity at the first sample, is fitted; gravity is
# not. A straight line and the parabola of gravity are all the model has, so the fit of
# the start is linear.

# +
case = read_case(folder, channels=("height_m",), split="drop")
residuals = {}
for recording in case:
    time, height = recording.time - recording.time[0], recording["height_m"]
    line = np.polynomial.Polynomial.fit(time, height + 9.81 / 2 * time**2, 1)
    start = line.convert().coef
    trajectory = jaxcam.simulate(
        FallingBody(), jnp.asarray(start), 0.0, float(time[-1])
    )
    assert trajectory.successful, trajectory.result
    residuals[recording.name] = time, height - np.asarray(trajectory.at(time))[:, 0]

print(f"{'drop':28} {'rms [m]':>8} {'largest [m]':>12}")
for name, (time, left_over) in residuals.items():
    rms, largest = np.sqrt(np.mean(left_over**2)), np.abs(left_over).max()
    print(f"{name:28} {rms:8.3f} {largest:12.3f}")
# -

# ## Picture

# +
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
balls = sorted({name.rpartition("_")[0] for name in residuals})
colours = dict(zip(balls, plt.cm.viridis(np.linspace(0, 0.9, len(balls)))))
for name, (time, left_over) in residuals.items():
    ball, _, drop = name.rpartition("_")
    axes.plot(
        time,
        left_over,
        color=colours[ball],
        linestyle="-" if drop.endswith("1") else "--",
        label=ball if drop.endswith("1") else None,
    )
axes.set(xlabel="time [s]", ylabel="measured less simulated height [m]")
axes.legend(fontsize="small")
# -

# A residual that bends upwards at the end is a body that is slower than free fall: the
# lighter a ball is for its size, the more. What is left of the heavy ones is the noise
# of reading heights from a film.
