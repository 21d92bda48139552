# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # A2. A branch of periodic orbits with impacts
#
# A forced oscillator hits a wall once per forcing period. We find this periodic orbit,
# compute its stability, and follow it as the wall moves. The orbit appears at a fold,
# loses its stability at a flip, and ends at a grazing bifurcation. (A callback ends the
# branch there. Without it, continuation proceeds with the orbit that has one more
# impact.)

# +
import matplotlib.pyplot as plt
import numpy as np

import continuation
import variational
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import branch_diagram


# -

# ## One orbit, and its stability

system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0], periods=1)
print(f"impact at {orbit.impacts.time[0]:.6f} s, multipliers {orbit.multipliers}")

# Free flight preserves areas in the phase plane, and an impact reduces them by the
# factor r squared. The product of the two multipliers is therefore r squared, here
# 0.64.

assert np.isclose(np.prod(orbit.multipliers).real, 0.8**2, rtol=1e-9)
stability = variational.stability(system, orbit)
print(f"test functions: fold {stability.fold:.4f}, flip {stability.flip:.4f}")

# ## Follow the branch as the wall moves

branch = continuation.branch(
    system,
    orbit,
    lambda s: s.wall,
    (-2.0, 0.1),
    direction="both",
    callbacks=[lambda point: point.kind == "grazing"],
)
for point in branch.special:
    print(f"{point.kind:>8} at wall = {point.parameter:.12f} ({point.converged=})")
print(branch)

# For comparison, the fold of the orbit with one impact per period has a closed form:

omega, r = 2.8, 0.8
gamma, turn = 1 / (1 - omega**2), 2 * np.pi / omega
k, m = (1 + r) / np.tan(turn / 2) / 2, (1 - r) / (2 * omega)
fold = -np.sign(k) * abs(gamma) * np.hypot(1, k / m)
print(f"fold by the formula: {fold:.12f}")
found = [point.parameter for point in branch.special if point.kind == "fold"]
assert min(abs(np.array(found) - fold)) < 1e-9

# Stable parts are drawn as solid lines, unstable parts as dashed lines.

figure = branch_diagram(
    branch,
    x_label=("position of the wall", "-"),
    y_label=("stroboscopic position", "-"),
)
plt.show()
