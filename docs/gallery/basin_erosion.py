"""The fraction of initial states that converge to each attractor, as a function of the
position of a wall."""

import matplotlib.pyplot as plt
import numpy as np

from jaxcam import sweeps
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import style


system = ImpactOscillator(omega=2.6, restitution=0.8, damping=0.02)
grid = sweeps.Grid((-3.0, -2.5), (0.0, 2.5), (32, 32))
walls = np.linspace(0.0, 0.4, 9)
found = sweeps.follow_basins(system, "wall", walls, grid, turns=200)

# label each attractor where its basin is largest; small basins share one band
most = found.shares.max(axis=0)
names = found.names[found.shares.argmax(axis=0), np.arange(len(most))]
order = np.argsort(-most)
large, small = order[most[order] > 0.03], order[most[order] <= 0.03]
bands = [*found.shares.T[large], found.shares.T[small].sum(axis=0)]
words = [*names[large], "others"]
colours = [*(f"C{k}" for k in range(len(large))), "0.6"]

with style():
    figure, ax = plt.subplots()
    shown = 100 * np.array(bands)
    ax.stackplot(found.values, shown, labels=words, colors=colours, alpha=0.85)
    ax.set(xlabel="position of the wall (–)", ylabel="fraction of states (%)")
    ax.set(xlim=(0.0, 0.4), ylim=(0, 100))
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
