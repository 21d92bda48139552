"""The two Floquet multipliers along a branch: one enters the unit circle through +1 at
a fold, both move along a circle whose radius is the coefficient of restitution, and one
leaves the unit circle through –1 at a flip."""

import matplotlib.pyplot as plt
import numpy as np

import continuation
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import multipliers, style


system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0], periods=1)
branch = continuation.branch(
    system,
    orbit,
    lambda s: s.wall,
    (-2.0, 0.1),
    direction="both",
    callbacks=[lambda point: point.kind == "grazing"],
)
with style():
    figure, ax = plt.subplots(figsize=(5.4, 4.8))
    multipliers(
        np.array([point.multipliers for point in branch.regular]), ax, reach=1.6
    )
    ax.annotate("fold", (1, 0), (1.1, 0.4), arrowprops={"arrowstyle": "->"})
    ax.annotate("flip", (-1, 0), (-1.45, 0.4), arrowprops={"arrowstyle": "->"})
