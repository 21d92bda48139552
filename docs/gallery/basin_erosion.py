"""How the wall takes states away from one motion and gives them to others: part of the
initial states that end on each attractor, while the wall moves."""

import matplotlib.pyplot as plt
import numpy as np

from jaxcam import sweeps
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import style


system = ImpactOscillator(omega=2.6, restitution=0.8, damping=0.02)
grid = sweeps.Grid((-3.0, -2.5), (0.0, 2.5), (40, 40))
walls = np.linspace(0.0, 0.45, 10)
found = sweeps.follow_basins(system, "wall", walls, grid, turns=150)

with style():
    figure, ax = plt.subplots()
    bands = ax.stackplot(found.values, 100 * found.shares.T, alpha=0.9)
for k, name in enumerate(found.names.T):
    print(k, name, found.shares[:, k].round(2))
