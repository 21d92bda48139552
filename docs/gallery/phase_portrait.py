"""A slowly driven mass: impacts on the wall, chatter, sticking, and release."""

import jaxcam
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import phase_portrait


system = ImpactOscillator(omega=0.35, restitution=0.6, wall=0.4, damping=0.05)
period = float(system.period)
trajectory = jaxcam.simulate(system, [0.0, 0.0], 0.0, 12 * period)

last_turn = (11 * period, 12 * period)
figure = phase_portrait(trajectory, between=last_turn)
