"""The basins of two coexisting attractors of an impact oscillator."""

from jaxcam import sweeps
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import basin_picture


system = ImpactOscillator(omega=2.6, restitution=0.8, wall=0.0)
grid = sweeps.Grid((-3.0, -2.5), (0.0, 2.5), (256, 256))
found = sweeps.basins(system, grid, turns=600, reruns=4)
figure = basin_picture(found)
