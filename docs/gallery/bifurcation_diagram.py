"""Bifurcation diagram of an impact oscillator as a function of the forcing frequency:
periodic windows, period doublings and chaos; darker regions contain more states, and
the thin line is the wall."""

import numpy as np

from jaxcam import sweeps
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import sweep_diagram


system = ImpactOscillator(omega=2.8, restitution=0.8, wall=0.0, damping=0.0)
made = sweeps.diagram(
    system,
    lambda s: s.omega,
    np.linspace(2.6, 3.4, 400),
    [-0.5, 0.5],
    turns=300,
    keep=100,
)
figure = sweep_diagram(
    made, x_label=("frequency", "–"), stops={"wall": float(system.wall)}
)
