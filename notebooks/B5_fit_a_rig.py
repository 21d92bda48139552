# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # B5. Fit a rig
#
# Three recordings ship with the package: four seconds each of a cam-follower rig at
# three speeds, through noisy encoders. We fit its spring, its cam and its restitution,
# ask what the recordings cannot tell, and what the error of a number is worth when the
# model lacks something. (The recordings were simulated, by code that shares nothing
# with the fit, so the truth is known. It has friction in its hinge.)

# +
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from jaxcam import fitting, HybridSystem
from jaxcam.data import DEMO_RIG
from jaxcam.data.make_demo import RealRig
from jaxcam.models import CamFollower
from jaxcam.plotting import style
from jaxcam.recordings import read_case, read_rig, segment_case


# -

# ## The model
#
# The textbook rig, and a term that is zero at first: viscous friction of the hinge. As
# a parameter that is held or freed it costs no second compilation.


class Hinged(HybridSystem):
    """The cam-follower with a viscous hinge."""

    rig: CamFollower
    damping: float = 0.0  # 1/s

    def vector_field(self, t, state):
        friction = jnp.stack([jnp.zeros_like(state[1]), -self.damping * state[1]])
        return self.rig.vector_field(t, state) + friction

    def gap(self, t, state):
        return self.rig.gap(t, state)

    def impact(self, t, state):
        return self.rig.impact(t, state)


# ## From files to a problem
#
# The rig file states nominal values, tolerances and sensors. A recording is cut where
# it hits and where it rests; each flight is predicted from its own start, so chaos does
# no harm. The cam turns as its encoder says.

# +
nominal = read_rig(DEMO_RIG / "rig.toml")
segments = segment_case(tuple(read_case(DEMO_RIG)), nominal)
angle = "follower_angle_rad"
model = fitting.Model(
    Hinged(nominal.system(1.0)),
    {angle: fitting.rig_sensors(nominal)[angle]},
    fitting.Turning(lambda s: s.rig.speed, lambda s: s.rig.phase),
)
textbook = fitting.cam_follower_parameters(nominal, base=lambda s: s.rig)
damping = fitting.Parameter("damping", lambda m: m.system.damping, lower=0.0)
problem = fitting.Problem.build(model, segments, [*textbook, damping])
print(f"{problem.samples} samples of {len(problem.records)} records")
# -

# ## The textbook rig
#
# Before anything is fitted: what can be seen at all? The spring acts through few
# combinations of its four numbers, so the others stay where the drawing has them.

# +
names = [parameter.name for parameter in textbook]
before = fitting.fit(problem, free=())
for sentence in fitting.identify(problem, names, at=before).sentences():
    print("-", sentence)


def left(fit):
    """What is left of each record, in units of the noise."""
    return [f"{part.rms / part.noise:.2f}" for part in fitting.residuals(fit)]


found = fitting.fit(problem, free=names)
again = fitting.bootstrap(found, 12)
print("times the noise left before and after:", left(before), left(found))
# -

# More than the noise in every record, and four times it in one: something is missing.
# The standard errors know only the noise, so they are too small. The bootstrap, which
# weights flights at random, says so for some; but no error bar tells of parameters that
# have taken over the part of what is missing, as the spring has here.

# ## With friction in the hinge

# +
whole = fitting.fit(problem, start=found)
print("times the noise left:", left(whole))
assert all(float(ratio) < 1.1 for ratio in left(whole))

real = RealRig()
truth = {
    "stiffness": real.stiffness_over_inertia * float(nominal.system(1.0).inertia),
    "spring_hook_x": real.spring_hook_x,
    "spring_elongation": real.spring_elongation,
    "spring_half_height": real.half_height,
    "cam_eccentricity": real.eccentricity,
    "cam_center_x": real.center_x,
    "cam_center_y": real.center_y,
    "restitution": real.restitution,
    "damping": real.damping,
}
scatter = dict(zip(names, again.stderr, strict=True))
print(f"{'':20} {'textbook +- stderr, bootstrap':^33} {'with friction':^19} truth")
for one in whole.estimates:
    row = " " * 33
    if one.name in names:
        old = found[one.name]
        row = f"{old.value:12.5f} {old.stderr:9.1e} {scatter[one.name]:9.1e}"
    true = f"{truth[one.name]:9.5f}" if one.name in truth else ""
    print(f"{one.name:20} {row:33} {one.value:10.5f} {one.stderr:8.1e} {true}")
off = (whole["restitution"].value - real.restitution) / whole["restitution"].stderr
assert abs(off) < 4
# -

# Who does not know which term to add asks `jaxcam diagnose`: it tries a library of
# them, and says `none` or `unknown` where none will do.

# ## A profile
#
# One parameter is held at several values, and all others are fitted again. Where the
# cost is a parabola, the standard error says it all.

# +
curve = fitting.profile(whole, "damping", points=7)
print("95 % interval of the damping (1/s):", np.round(curve.interval, 4))
with style():
    figure, ax = plt.subplots(layout="constrained")
    estimate = whole["damping"]
    x = np.linspace(*curve.values[[0, -1]], 100)
    ax.plot(x, ((x - estimate.value) / estimate.stderr) ** 2, "--", label="stderr")
    ax.plot(curve.values, curve.cost, "o", label="profile")
    ax.axvline(real.damping, color="black", lw=0.8, label="truth")
    ax.axhline(3.84, color="black", lw=0.8, ls=":", label="95 %")
    ax.set(xlabel="damping of the hinge (1/s)", ylabel="cost above the best fit (-)")
    ax.legend()
plt.show()
