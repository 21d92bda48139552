# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # B1. Stability: saltation, multipliers, and curves of bifurcations
#
# A2 follows one branch and finds a fold, a flip and a grazing on it. Here we look
# inside: what an impact does to a small deviation, what a turn does to it, and where
# in the plane of two parameters the orbit exists and is stable. (B2 does the same for
# the cam-follower.)

# +
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import continuation
import variational
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import branch_diagram, multipliers, special_curves, style


# -

# ## What an impact does to a deviation
#
# A neighbour hits a little earlier or later than the orbit, and in between the two obey
# different fields. To first order a deviation is multiplied by the saltation matrix, in
# which the impact speed stands below. One turn from just after the impact is a free
# flight and then the impact, so two matrices make the monodromy matrix.

# +
system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0], periods=1)
hit = float(orbit.impacts.time[0])
saltation = variational.saltation_matrix(system, hit, orbit.impacts.before[0])
print("saltation matrix\n", saltation)

# flight is x'' + x = cos(omega t): a rotation of the plane (x, x') by the time flown
turn = float(orbit.period)
rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
by_hand = np.asarray(saltation) @ rotation
print("multipliers by hand:", np.sort(np.linalg.eigvals(by_hand).real))
print("of the orbit:       ", np.sort(orbit.multipliers.real))
np.testing.assert_allclose(
    np.sort(np.linalg.eigvals(by_hand)), np.sort(orbit.multipliers), rtol=1e-8
)
# -

# The package has two ways to the same matrix: it multiplies such factors, or it
# differentiates the event loop. They share no formula.

product = variational.monodromy(system, orbit, method="product")
differentiated = variational.monodromy(system, orbit, method="flow")
print("largest difference of the two:", abs(product - differentiated).max())
assert jnp.allclose(product, differentiated, atol=1e-8)

# ## Along a branch
#
# While the wall moves, the two multipliers of the orbit leave +1 at the fold and reach
# -1 at the flip. Their product is the restitution squared, all the way.

# +


def wall(s):
    return s.wall


def ends(point):
    return point.kind == "grazing"


branch = continuation.branch(
    system, orbit, wall, (-2.0, 0.1), direction="both", callbacks=[ends]
)
special = {point.kind: point for point in branch.special}
along = np.array([p.multipliers for p in branch.regular])
np.testing.assert_allclose(np.prod(along, axis=1).real, 0.8**2, rtol=1e-8)
with style():
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(10, 4), width_ratios=(3, 2), layout="constrained"
    )
branch_diagram(
    branch,
    left,
    x_label=("position of the wall", "-"),
    y_label=("position once a period", "-"),
)
drawn = multipliers(along, right, reach=2.0)
# -

# ## Curves in two parameters
#
# At a fold and at a flip one more equation holds, so each of them is a curve in a plane
# of two parameters: here the wall and the frequency. Between the two curves the orbit
# is stable. Dots are the closed forms.


# +
def omega(s):
    return s.omega


bounds = ((-3.0, 0.3), (2.4, 3.2))
curves = {
    kind: continuation.curve(special[kind], (wall, omega), bounds)
    for kind in ("fold", "flip")
}


def closed_form(w, r=0.8):
    """Walls of the fold and the flip of the orbit with one impact a period."""
    gamma, half = 1 / (1 - w * w), np.pi / w
    k, m = (1 + r) / np.tan(half) / 2, (1 - r) / (2 * w)
    c, s = np.cos(2 * half), np.sin(2 * half)
    fold = np.arctan2(abs(k), -m * np.sign(k))
    top = 1 + r * r - 2 * r * c + (1 + r) ** 2 * (1 - w * w) * (1 + c) / 2
    flip = np.arctan2(m, top / ((1 + r) * s * w * w) + k)
    walls = [
        abs(gamma) * np.cos(phi) - k * abs(gamma) * np.sin(phi) / m
        for phi in (fold, flip)
    ]
    return dict(zip(("fold", "flip"), walls))


with style():
    figure, ax = plt.subplots(layout="constrained")
for kind, curve in curves.items():
    points = np.array([p.parameters for p in curve.points])
    exact = np.array([closed_form(w)[kind] for w in points[:, 1]])
    name = "closed forms" if kind == "flip" else None
    ax.plot(exact, points[:, 1], "k.", markersize=3, zorder=3, label=name)
    print(f"{kind}: largest error {abs(points[:, 0] - exact).max():.1e}")
    assert abs(points[:, 0] - exact).max() < 1e-8
ax.text(-0.9, 2.6, "stable")
drawn = special_curves(
    curves.values(),
    ax,
    x_label=("position of the wall", "-"),
    y_label=("frequency of the forcing", "-"),
)
plt.show()
