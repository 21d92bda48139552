"""Period adding beyond a grazing bifurcation: towards the bifurcation at zero, windows
of period 3, 4, 5, ... follow one another, with chaos in between."""

import matplotlib.pyplot as plt
import numpy as np

from jaxcam.maps import map_diagram, SquareRootMap
from jaxcam.plotting import style
from jaxcam.plotting.colours import FLIGHT


values = np.linspace(0.002, 0.12, 900)
settled = map_diagram(SquareRootMap(0.6, 0.1), lambda s: s.mu, values, keep=150)
depth = np.repeat(values, 150)

with style():
    figure, ax = plt.subplots()
    ax.plot(depth, np.ravel(settled), ".", ms=1.0, mew=0, alpha=0.35, color=FLIGHT)
    ax.set(xlabel=r"parameter $\mu$ (–)", ylabel="stroboscopic state (–)")
    ax.axhline(0, color="0.4", lw=0.8, ls=":")
    ax.text(0.12, 0.004, "no impact below", ha="right", fontsize="small")
