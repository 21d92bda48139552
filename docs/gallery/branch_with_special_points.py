"""A branch of orbits with one impact per period: the orbits are stable between a fold
and a flip, and the branch ends where its orbit grazes the wall."""

import continuation
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import branch_diagram


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
figure = branch_diagram(
    branch,
    x_label=("position of the wall", "–"),
    y_label=("stroboscopic position", "–"),
)
