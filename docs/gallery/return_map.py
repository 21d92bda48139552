"""The phase of each impact, plotted against that of the previous impact, in a chaotic
motion: the points lie on a few thin curves, so one impact nearly determines the time
of the next."""

import jaxcam
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import impact_return_map


system = ImpactOscillator(omega=2.9, restitution=0.8, wall=0.0, damping=0.1)
period = float(system.period)
trajectory = jaxcam.simulate(system, [-0.5, 0.5], 0.0, 600 * period)
figure = impact_return_map(trajectory, between=(100 * period, 600 * period))
