# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # B1. Stability: saltation, multipliers, and bifurcation curves
#
# Notebook A2 follows one branch and finds a fold, a flip and a grazing bifurcation on
# it. Here we examine how a small perturbation changes at an impact and over one period,
# and where in the plane of two parameters the orbit exists and is stable. (Notebook B2
# studies the cam-follower.)

# +
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import continuation
import variational
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import branch_diagram, multipliers, special_curves, style


# -

# ## How an impact changes a perturbation
#
# A neighbouring trajectory has its impact slightly earlier or later than the orbit, and
# between the two impacts one trajectory is still in flight and the other has already
# rebounded. To first order, the impact multiplies a perturbation by the saltation
# matrix, which has the impact speed in the denominator. One period, starting just after
# the impact, consists of a free flight and an impact, so the monodromy matrix is the
# product of two matrices.

# +
system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0], periods=1)
hit = float(orbit.impacts.time[0])
saltation = variational.saltation_matrix(system, hit, orbit.impacts.before[0])
print("saltation matrix\n", saltation)

# in flight x'' + x = cos(omega t): perturbations rotate in the (x, x') plane, and the
# angle is the time of flight
turn = float(orbit.period)
rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
by_hand = np.asarray(saltation) @ rotation
print("multipliers by hand:", np.sort(np.linalg.eigvals(by_hand).real))
print("of the orbit:       ", np.sort(orbit.multipliers.real))
np.testing.assert_allclose(
    np.sort(np.linalg.eigvals(by_hand)), np.sort(orbit.multipliers), rtol=1e-8
)
# -

# The package computes the monodromy matrix in two ways: as a product of saltation
# matrices and flight derivatives, or by differentiating the event loop. The two methods
# have no formula in common.

product = variational.monodromy(system, orbit, method="product")
differentiated = variational.monodromy(system, orbit, method="flow")
print("largest difference between the two:", abs(product - differentiated).max())
assert jnp.allclose(product, differentiated, atol=1e-8)

# ## Multipliers along a branch
#
# At the fold one of the two multipliers of the orbit is +1, and at the flip one is -1.
# Along the whole branch their product is the square of the coefficient of restitution.

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
    y_label=("stroboscopic position", "-"),
)
drawn = multipliers(along, right, reach=2.0)
# -

# ## Curves in two parameters
#
# A fold or a flip satisfies one additional equation, so it forms a curve in the plane
# of two parameters, here the position of the wall and the frequency. The orbit is
# stable between the two curves. The dots are closed-form values.


# +
def omega(s):
    return s.omega


bounds = ((-3.0, 0.3), (2.4, 3.2))
curves = {
    kind: continuation.curve(special[kind], (wall, omega), bounds)
    for kind in ("fold", "flip")
}


def closed_form(w, r=0.8):
    """Return the wall positions of the fold and the flip of the orbit."""
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
