"""Thousands of states of a chaotic impact oscillator, one per period: a strange
attractor with the fingers that are typical of grazing impacts."""

import matplotlib.pyplot as plt
import numpy as np

from jaxcam.hybrid import stroboscope
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import style
from jaxcam.plotting.colours import FLIGHT


system = ImpactOscillator(omega=2.9, restitution=0.8, wall=0.0)
starts = np.random.default_rng(0).uniform(-1, 0, (64, 2))
states = stroboscope(system, starts, turns=400, skip=100).states.reshape(-1, 2)

with style():
    figure, ax = plt.subplots()
    ax.plot(*states.T, ".", ms=0.9, mew=0, color=FLIGHT, rasterized=True)
    ax.set(xlabel="stroboscopic position (–)", ylabel="stroboscopic velocity (–)")
