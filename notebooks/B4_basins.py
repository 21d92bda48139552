# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # B4. Two motions at once, and their basins
#
# Pushed from one state, an oscillator settles on one impact a period; from another,
# close by, on six impacts in six periods. Which states lead where? And how well is that
# known, when the boundary is folded as finely as this one?

# +
import matplotlib.pyplot as plt
import numpy as np

import continuation
import jaxcam
from jaxcam import sweeps
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import basin_picture, phase_portrait, style


# -

# ## The basins
#
# Every state of a grid is followed until it repeats. Those that do not repeat in the
# first 400 turns go on for twice as many, and so on: the way to P(6,6) takes some
# thousand turns, and who stops earlier takes it for chaos.

# +
system = ImpactOscillator(omega=2.6, restitution=0.8, wall=0.0)
grid = sweeps.Grid((-3.0, -2.5), (0.0, 2.5), (96, 96))
found = sweeps.basins(system, grid, turns=400, reruns=4)
for name, share in found.shares.items():
    print(f"{name}: {share.share:.1%} +- {share.stderr:.1%}")
assert found.names == ["P(1,1)", "P(6,6)"]
figure = basin_picture(found)
# -

# A number has no error bar unless it says how it was drawn; here it is that of as many
# states drawn at random.

# ## The attractors themselves
#
# Each is followed for one of its periods. Its multipliers say why one is reached so
# slowly: they are close to the unit circle.

# +
with style():
    figure, panels = plt.subplots(1, 2, figsize=(9, 4.2), layout="constrained")
for ax, name, points in zip(panels, found.names, found.orbits, strict=True):
    turns = int(np.isfinite(points[:, 0]).sum())
    orbit = continuation.periodic_orbit(system, points[0], periods=turns)
    size = abs(orbit.multipliers).max()
    turns_to_settle = -turns / np.log(size)
    print(f"{name}: |mu| = {size:.6f}, {turns_to_settle:.0f} turns for a factor e")
    assert size < 1
    run = jaxcam.simulate(system, orbit.state, orbit.time, orbit.time + orbit.period)
    phase_portrait(run, ax)
    ax.text(0.5, 0.5, name, transform=ax.transAxes, ha="center")
# -

# ## How well the end is known
#
# The uncertainty exponent, from the picture alone: where the error of the initial state
# is halved, the part of states whose end is uncertain shrinks only by two to the power
# of this exponent. The box dimension of the boundary is that of the plane less it.

# +
uncertain = sweeps.uncertainty_exponent(found.attractor)
print(f"exponent {uncertain.exponent:.2f} +- {uncertain.stderr:.2f}")
print(f"dimension of the boundary {uncertain.dimension:.2f}")
print(f"twice as exact: {2**-uncertain.exponent:.0%} of the uncertain states are left")
assert 0 < uncertain.exponent < 1 < uncertain.dimension < 2
plt.show()
