# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # A1. Falling balls
#
# Several balls were dropped from a bridge, each of them twice, and filmed at 15 frames
# per second (de Silva et al. 2020, MIT licence). According to the textbook, all balls
# fall in the same way. Do they?
#
# The recordings are not part of the package. Put them into the folder `real/ball_drop`,
# and set the environment variable `JAXCAM_RECORDINGS` to the folder that contains
# `real`. Without the recordings, this notebook prints a message and stops.

# +
import os
import sys
from pathlib import Path

import jax.numpy as jnp
import matplotlib.pyplot as plt
from rich.console import Console

import jaxcam
from jaxcam.plotting import residual_by_mode, style
from jaxcam.recordings import compare, merge, read_case, segment


root = Path(os.environ.get("JAXCAM_RECORDINGS", "."))
folder = root / "real" / "ball_drop"
if not folder.is_dir():
    print(f"Skipped: there is no folder {folder}; set JAXCAM_RECORDINGS.")
    sys.exit()
# -

# ## A falling body in ten lines


class FallingBody(jaxcam.HybridSystem):
    """Free fall above the water; the state is height (m) and velocity (m/s)."""

    gravity: float = 9.81
    restitution: float = 0.0

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.gravity])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


# ## The residual of each drop
#
# Each drop is one flight. Its initial state is fitted, but gravity is not. The residual
# shows what the model lacks; it is given in units of the noise.

# +
case = read_case(folder, channels=("height_m",), split="drop")
parts = {
    recording.name: compare(FallingBody(), segment(recording, "height_m"))
    for recording in case
}
comparison = merge(list(parts.values()))

print(f"{'drop':24} {'rms (m)':>8} {'times the noise':>16}")
for name, part in parts.items():
    row = part.row("flight")
    print(f"{name:24} {row.rms:8.2f} {row.ratio:16.1f}")
print(comparison.sentence())
# -

Console().print(comparison.table())

# ## Figure

# The upper panels show the heaviest ball and the lower panels the lightest. Grey bands
# show plus and minus two standard deviations of the noise.

# +
with style():
    figure, grid = plt.subplots(2, 2, figsize=(8, 5))
for panels, name in zip(grid, ("bowling_ball_drop1", "whiffle_ball_1_drop1")):
    residual_by_mode(comparison, panels, record=name)
# -

# Because the initial state is fitted to the whole drop, part of the discrepancy is
# hidden, and a curved residual remains: high at both ends and low in between. Such a
# residual indicates that the acceleration decreases as the ball gets faster. The
# curvature is largest for the lightest ball and barely visible for the heaviest. The
# model lacks air drag.
