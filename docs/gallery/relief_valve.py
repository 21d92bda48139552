"""Maxima of the lift of a relief valve without forcing, as a function of the flow
rate: the valve hits its seat at low flow rates and comes to rest at high flow rates."""

import numpy as np

from jaxcam import sweeps
from jaxcam.models import ReliefValve
from jaxcam.plotting import sweep_diagram


maxima = sweeps.PoincareSection(
    ReliefValve(), lambda t, state: state[1], direction=-1, period=3.0
)
made = sweeps.diagram(
    maxima, "flow", np.linspace(0.5, 10.0, 400), (0.2, 0.0, 10.0), turns=250, keep=80
)
figure = sweep_diagram(made, x_label=("flow", "–"))
