# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # B4. Two coexisting attractors and their basins
#
# From one initial state, an oscillator settles to an orbit with one impact per period.
# From another initial state nearby, it settles to an orbit with six impacts in six
# periods. Which initial states lead to which orbit? And how well can the final orbit be
# predicted if the basin boundary is as finely folded as it is here?

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
# The motion from every state of a grid is simulated until it repeats. The simulation of
# a motion that does not repeat within 400 periods is extended to twice its length,
# repeatedly if necessary. The transient to P(6,6) lasts about a thousand periods and
# would otherwise be mistaken for chaos.

# +
system = ImpactOscillator(omega=2.6, restitution=0.8, wall=0.0)
grid = sweeps.Grid((-3.0, -2.5), (0.0, 2.5), (96, 96))
found = sweeps.basins(system, grid, turns=400, reruns=4)
for name, share in found.shares.items():
    print(f"{name}: {share.share:.1%} +- {share.stderr:.1%}")
assert found.names == ["P(1,1)", "P(6,6)"]
figure = basin_picture(found)
# -

# The standard errors are those that would apply to an equal number of initial states
# drawn at random.

# ## The attractors
#
# Each attractor is simulated for one of its periods. The multipliers of P(6,6) are
# close to the unit circle, which explains why this orbit is reached so slowly.

# +
with style():
    figure, panels = plt.subplots(1, 2, figsize=(9, 4.2), layout="constrained")
for ax, name, points in zip(panels, found.names, found.orbits, strict=True):
    turns = int(np.isfinite(points[:, 0]).sum())
    orbit = continuation.periodic_orbit(system, points[0], periods=turns)
    size = abs(orbit.multipliers).max()
    turns_to_settle = -turns / np.log(size)
    print(f"{name}: |mu| = {size:.6f}, time constant {turns_to_settle:.0f} periods")
    assert size < 1
    run = jaxcam.simulate(system, orbit.state, orbit.time, orbit.time + orbit.period)
    phase_portrait(run, ax)
    ax.text(0.5, 0.5, name, transform=ax.transAxes, ha="center")
# -

# ## How well the attractor can be predicted
#
# The uncertainty exponent is computed from the basins alone. If the error of the
# initial state is halved, the fraction of states with an uncertain attractor falls only
# by the factor $2^\alpha$, where $\alpha$ is this exponent. The box dimension of the
# basin boundary is two (the dimension of the plane) minus the exponent.

# +
uncertain = sweeps.uncertainty_exponent(found.attractor)
print(f"exponent {uncertain.exponent:.2f} +- {uncertain.stderr:.2f}")
print(f"dimension of the boundary {uncertain.dimension:.2f}")
print(f"error halved: {2**-uncertain.exponent:.0%} of the uncertain states remain")
assert 0 < uncertain.exponent < 1 < uncertain.dimension < 2
plt.show()
