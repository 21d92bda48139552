# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # B3. The onset of chaos
#
# This notebook illustrates the main result of the thesis (chapter 6). Below 152.67 rpm
# the follower completes its chatter once per revolution, sticks to the cam and is
# released, so every revolution is the same. Above this speed the release comes before
# the chatter is complete. The follower then does not stick, and the motion becomes
# chaotic at once, without a period doubling. `docs/chatter.md` explains the theory;
# this notebook draws its maps.

# +
import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import continuation
import jaxcam
import variational
from jaxcam.hybrid import stroboscope
from jaxcam.models import preset, rad_s_to_rpm, rpm_to_rad_s
from jaxcam.plotting import (
    beta_lobes,
    cobweb,
    lambda_cobweb,
    lobe_scaling,
    style,
)


def speed(s):
    return s.speed


def at(value):
    return eqx.tree_at(speed, rig, jnp.asarray(value))


rig = preset("calibrated")
# -

# ## The interruption of chatter
#
# At the interruption, the impacts accumulate exactly at the release, and the sticking
# time falls to zero. The sticking time is not a smooth function of the speed there. We
# therefore search for the zero of a smooth function instead, the margin (see
# `docs/chatter.md`).

bracket = (rpm_to_rad_s(150.0), rpm_to_rad_s(154.0))
critical = continuation.chatter_interruption(rig, speed, bracket)
print(f"complete chatter ends at {rad_s_to_rpm(critical):.5f} rpm")

# The figure shows the gap near the release at speeds slightly below and slightly above
# the interruption. The gaps shrink so fast that their cube root is drawn.

# +
frame = variational.chatter_frame(at(critical))
period = float(at(critical).period)

with style():
    figure, panels = plt.subplots(2, 1, figsize=(6.4, 4.2), layout="constrained")
    for ax, shift, name in zip(panels, (-0.3, 0.3), ("below", "above")):
        near = at(critical + rpm_to_rad_s(shift))
        run = jaxcam.simulate(near, None, 0.0, 2.2 * period)
        release = float(variational.chatter_frame(near).release)
        end = release + float(near.period) * np.ceil((0.6 * period - release) / period)
        times = np.linspace(end - 0.06, end + 0.04, 4000)
        gaps = np.asarray(run.gap(times))
        ax.plot(1e3 * (times - end), np.cbrt(np.maximum(gaps, 0.0)))
        ax.axvline(0.0, color="black", lw=0.8, ls=":")
        ax.set_ylabel("cube root of gap")
        ax.set_title(f"{rad_s_to_rpm(near.speed):.2f} rpm, {name}", loc="left")
    panels[-1].set_xlabel("time from release (ms)")
# -

# ## The lambda-map from impact to impact
#
# Near the release, the acceleration that presses the follower onto the cam is
# proportional to the time $\tau$ from release: it is $c\tau$. Let $u$ be the rebound
# speed and $\lambda = u/(c\tau^2)$. Each flight is then a map of $\lambda$ that depends
# only on the coefficient of restitution $r$. The fixed point of this map is unstable.
# If $\lambda$ is below the fixed point, the chatter completes in time. If $\lambda$ is
# above it, the impacts are too fast: $\lambda$ grows beyond $3/8$, and the follower
# does not return.

# +
r = float(frame.restitution)
law = variational.scaling_law(r)
print(
    f"r = {r:.4f}: lambda_bar = {law.lambda_bar:.5f}, p = {law.p:.4f}, q = {law.q:.4f}"
)
with style():
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(10, 4.2), width_ratios=(2, 3), layout="constrained"
    )
lambda_cobweb(r, left)

# The beta-map combines all remaining impacts of an interrupted sequence in one
# function. For comparison, one impact is perturbed and the motion is simulated to the
# end of the cycle.

composed = variational.composed_map(at(critical), speed, 36)
corners = [3 / 8]
for _ in range(8):
    corners.append(float(variational.lambda_inverse(corners[-1], r)))
share = np.linspace(0.01, 0.99, 40) ** 2
deviation = np.array([a + share * (b - a) for a, b in zip(corners, corners[1:])])
deviation -= float(law.lambda_bar)
moved = variational.simulated_at_section(
    at(critical), composed, deviation.ravel() / float(composed.covector[0])
)
left_over = np.asarray(moved.velocity).reshape(deviation.shape)
left_over = left_over - float(composed.relative[1])
scale = float(composed.tau) ** 2 * float(composed.relative_vector[1])
simulated = left_over / scale
few = slice(0, 4)
drawn = beta_lobes(r, right, measured=(deviation[few].ravel(), simulated[few].ravel()))
# -

# Each lobe is narrower by the factor $q$ and lower by the factor $p^2$ than the next
# lobe outside it. The heights of the lobes therefore follow a power law with the
# exponent $\kappa = 2\ln p/\ln q$, which the simulated motion obeys over two decades.

depth = np.max(np.abs(simulated), axis=1)
exponent = np.polyfit(np.log(deviation[2:, 0]), np.log(depth[2:]), 1)[0]
print(f"kappa = {law.kappa:.4f} in theory, {exponent:.4f} in the simulation")
assert abs(exponent / float(law.kappa) - 1) < 0.02
drawn = lobe_scaling(deviation[:, 0], depth, float(law.kappa))

# ## The map over one revolution
#
# After the last impact all states lie on one line, so a single number describes the
# state sampled once per revolution, and one revolution is a map of this number (section
# 5.4 of the thesis). The map is computed at the interruption by simulating one
# revolution from each of 900 states. The map is flat where the chatter completes, and
# has lobes where the chatter is interrupted. A change of the speed shifts the map
# sideways. The fixed point then leaves the flat part and lies among lobes with slopes
# steeper than one, which makes the motion chaotic.

# +
interrupted = at(critical)
start = composed.state
along = composed.vector / composed.vector[0]


@jax.jit
@jax.vmap
def turn(deviation):
    return variational.section_turn(interrupted, start + deviation * along).state


inside = np.geomspace(1e-6, 1e-3, 900)
points = np.concatenate([[-1e-3, 0.0], inside])
images = np.asarray(turn(points)[:, 0] - start[0])
rate = composed.incidence * composed.vector[0] / composed.feedback
print(f"the map shifts by {rate * rpm_to_rad_s(1.0):.6f} rad / rpm")


def moved_map(deviation, shift):
    return np.interp(deviation + shift, points, images)


# the simulated motion, and the map shifted according to the theory
rpm = np.linspace(-0.02, 0.15, 171)
beyond = np.asarray(rpm_to_rad_s(rpm))
motion = stroboscope(
    rig, start, 200, skip=160, where=speed, values=float(critical) + beyond
)
iterated = np.zeros((200, len(rpm)))
for k in range(199):
    iterated[k + 1] = moved_map(iterated[k], float(rate) * beyond)

shift = float(rate) * float(rpm_to_rad_s(0.1))
micro = 1e6  # rad to microrad


def turn_in_microrad(x):
    return jnp.asarray(micro * moved_map(np.asarray(x) / micro, shift))


with style():
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.4), layout="constrained")
    cobweb(turn_in_microrad, 0.0, 60, left, skip=30)
    deviation = micro * (motion.states[:, :, 0] - float(start[0]))
    right.plot(np.repeat(rpm, 40), deviation.ravel(), ",", color="C1")
    right.plot(np.repeat(rpm, 40), micro * iterated[160:].T.ravel(), ",", color="C0")
    right.plot([], [], "C1.", label="simulation")
    right.plot([], [], "C0.", label="map")
    right.legend(loc="upper left")
    left.set(xlabel="deviation (µrad)", ylabel="one revolution later (µrad)")
    right.set(xlabel="speed beyond the interruption (rpm)", ylabel="deviation (µrad)")

widths = np.ptp(motion.states[:, :, 0], axis=1)
predicted = np.ptp(iterated[160:], axis=0)
for nearest in (-0.01, 0.05, 0.1):
    k = int(np.argmin(abs(rpm - nearest)))
    print(f"{rpm[k]:+.3f} rpm: width {widths[k]:.2e} rad, map {predicted[k]:.2e} rad")
assert widths[rpm < -0.005].max() < 1e-9 < 1e-5 < widths[rpm > 0.05].min()
plt.show()
