# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # A2. A branch of impacting orbits
#
# An oscillator that hits a wall once in every period of its forcing. We find the orbit,
# ask how stable it is, and follow it while the wall moves: it is born at a fold, loses
# its stability at a flip, and ends where it grazes. (Without the callback that stops
# there, the path follower goes on with the orbit that has one impact more.)

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

# Free flight keeps areas and the impact shrinks them by r squared, so the product of
# the two multipliers is r squared, here 0.64.

assert np.isclose(np.prod(orbit.multipliers).real, 0.8**2, rtol=1e-9)
stability = variational.stability(system, orbit)
print(f"test functions: fold {stability.fold:.4f}, flip {stability.flip:.4f}")

# ## The branch while the wall moves

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

# The closed form of the fold of the orbit with one impact a period, for comparison.

omega, r = 2.8, 0.8
gamma, turn = 1 / (1 - omega**2), 2 * np.pi / omega
k, m = (1 + r) / np.tan(turn / 2) / 2, (1 - r) / (2 * omega)
fold = -np.sign(k) * abs(gamma) * np.hypot(1, k / m)
print(f"fold by the formula: {fold:.12f}")
found = [point.parameter for point in branch.special if point.kind == "fold"]
assert min(abs(np.array(found) - fold)) < 1e-9

# Stable parts are drawn solid, unstable ones dashed.

figure = branch_diagram(
    branch,
    x_label=("position of the wall", "-"),
    y_label=("position once a period", "-"),
)
plt.show()
