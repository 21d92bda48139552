# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # B5. Fit the parameters of a rig
#
# The package contains three simulated recordings, each of four seconds, of a
# cam-follower rig with noisy encoders at three speeds. The program that simulated them
# shares no code with the fit, and the simulated rig has friction in its hinge. We fit
# the parameters of the spring, the cam and the restitution, find the parameters that
# the recordings cannot determine, and compare the results with the true values to see
# how reliable the standard errors are if the model lacks an effect.

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
# The model is the textbook rig plus viscous friction in the hinge, which is zero at
# first. Because the friction is a parameter that can be fixed or free, the model is
# compiled only once.


class Hinged(HybridSystem):
    """The cam-follower with viscous friction in the hinge."""

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
# The rig file contains nominal values, tolerances and sensors. Each recording is
# divided at impacts and contacts. Each flight is predicted from its own initial state,
# so chaotic motion is not a problem. The angle of the cam is taken from its encoder.

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
print(f"{problem.samples} samples in {len(problem.records)} recordings")
# -

# ## The textbook rig
#
# Before fitting we ask which parameters the data can determine. The spring acts only
# through a few combinations of its four parameters, so the other combinations keep
# their nominal values.

# +
names = [parameter.name for parameter in textbook]
before = fitting.fit(problem, free=())
for sentence in fitting.identify(problem, names, at=before).sentences():
    print("-", sentence)


def left(fit):
    """Return the residual of each recording in units of the noise."""
    return [f"{part.rms / part.noise:.2f}" for part in fitting.residuals(fit)]


found = fitting.fit(problem, free=names)
again = fitting.bootstrap(found, 12)
print("residual / noise, before and after the fit:", left(before), left(found))
# -

# The residual exceeds the noise in every recording, and in one it is four times the
# noise, so the model lacks an effect. The standard errors take only the noise into
# account and are too small. The bootstrap, which gives the flights random weights,
# shows this for some parameters. But neither kind of standard error reveals that a
# parameter has absorbed part of the missing effect, as the parameters of the spring
# have here.

# ## The rig with friction in the hinge

# +
whole = fitting.fit(problem, start=found)
print("residual / noise:", left(whole))
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

# If you do not know which term to add, use `jaxcam diagnose`. It tests a library of
# terms, and reports `none` if it detects no missing physics and `unknown` if no term
# is sufficient.

# ## A profile likelihood
#
# One parameter is fixed at several values, and all others are fitted again. If the cost
# is a parabola, the standard error describes the uncertainty completely.

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
    ax.set(xlabel="damping of the hinge (1/s)", ylabel="cost above the best fit (–)")
    ax.legend()
plt.show()
