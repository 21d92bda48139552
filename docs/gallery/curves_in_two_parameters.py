"""A fold curve and a flip curve in a two-parameter plane (wall position and forcing
frequency): between the two curves, the orbit with one impact per period is stable."""

import continuation
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import special_curves


def wall(s):
    return s.wall


def omega(s):
    return s.omega


def grazes(point):
    return point.kind == "grazing"


system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0], periods=1)
branch = continuation.branch(
    system, orbit, wall, (-2.0, 0.1), direction="both", callbacks=[grazes]
)
bounds = ((-3.0, 0.3), (2.4, 3.2))
curves = [
    continuation.curve(branch.of_kind(kind)[0], (wall, omega), bounds)
    for kind in ("fold", "flip")
]
figure = special_curves(
    curves, x_label=("position of the wall", "–"), y_label=("frequency", "–")
)
figure.axes[0].text(-1.1, 2.85, "stable")
