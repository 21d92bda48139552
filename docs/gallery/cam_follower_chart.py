"""Bifurcations of the cam-follower in the plane of speed and coefficient of
restitution: the orbit with one impact per cycle is stable between its fold and its
flip, and chatter is complete between detachment and interruption."""

import equinox as eqx
import jax.numpy as jnp

import continuation
from jaxcam.models import preset, rad_s_to_rpm, rpm_to_rad_s
from jaxcam.plotting import special_curves


def speed(s):
    return s.speed


def intercept(s):
    return s.restitution.intercept


# speed (rpm), a state near the orbit, and the kinds of special point on its branch
orbits = [
    (145.0, [0.4245, 1.8281], ("fold", "flip")),
    (145.0, None, ("detachment", "interruption of chatter")),
    (152.69, [0.3383, 0.2427], ("grazing",)),
]
bounds = ((rpm_to_rad_s(120.0), rpm_to_rad_s(165.0)), (-0.66, -0.58))
curves = []
for rpm, guess, kinds in orbits:
    rig = eqx.tree_at(speed, preset("calibrated"), jnp.asarray(rpm_to_rad_s(rpm)))
    orbit = continuation.periodic_orbit(rig, guess, periods=1)
    branch = continuation.branch(
        rig,
        orbit,
        speed,
        bounds[0],
        direction="both" if len(kinds) > 1 else 1,
        callbacks=[lambda point, kinds=kinds: point.kind in kinds],
    )
    for kind in kinds:
        point = branch.of_kind(kind)[0]
        curves.append(continuation.curve(point, (speed, intercept), bounds))
figure = special_curves(
    curves,
    x_label=("speed", "rpm"),
    y_label=("intercept of the restitution law", "–"),
    x_scale=rad_s_to_rpm(1.0),
)
