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
from rich.console import Console

import jaxcam
from jaxcam.plotting import residual_by_mode, style
from jaxcam.recordings import compare, merge, read_case, segment


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
# Each drop is one flight. Its start is fitted, gravity is not; what is left over is
# what the model lacks, and is measured in units of the noise.

# +
case = read_case(folder, channels=("height_m",), split="drop")
parts = {
    recording.name: compare(FallingBody(), segment(recording, "height_m"))
    for recording in case
}
comparison = merge(list(parts.values()))

print(f"{'drop':24} {'rms [m]':>8} {'times the noise':>16}")
for name, part in parts.items():
    row = part.row("flight")
    print(f"{name:24} {row.rms:8.2f} {row.ratio:16.1f}")
print(comparison.sentence())
# -

Console().print(comparison.table())

# ## Picture

# The heaviest ball above, the lightest below; grey is the noise.

# +
with style():
    figure, grid = plt.subplots(2, 2, figsize=(8, 5))
for panels, name in zip(grid, ("bowling_ball_drop1", "whiffle_ball_1_drop1")):
    residual_by_mode(comparison, panels, record=name)
# -

# A start fitted to the whole drop hides part of the mismatch and leaves a bow: high at
# both ends, low in between. That is a body that loses acceleration as it gets faster.
# The bow is deepest for the lightest ball and hardly there for the heaviest: what is
# missing is the drag of the air.
