# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # B6. Gradient-based design: a cam with a higher float speed
#
# The follower of the rig in the thesis first leaves its cam at 125 rpm (valve float).
# We want to raise this speed to 135 rpm. A stiffer spring would do this, but it would
# increase the contact force throughout the cycle. Instead we change the cam profile:
# the lift must stay the same, and the contact force, which wears the cam, must be as
# small as possible. Derivatives of the float speed and of the load guide the design.

# +
import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize

import jaxcam
import variational
from jaxcam.models import (
    contact_load,
    float_speed,
    FourierProfile,
    preset,
    rad_s_to_rpm,
    rpm_to_rad_s,
)
from jaxcam.plotting import style


rig = preset("calibrated")
wanted = float(rpm_to_rad_s(135.0))
# -

# ## Sensitivity of the float speed
#
# The float speed is the lowest speed at which a tensile contact force would be needed.
# One gradient in reverse mode gives its derivative with respect to every parameter.

# +
now = float_speed(rig)
by = eqx.filter_grad(lambda system: float_speed(system).speed)(rig)
print(f"the valve floats at {rad_s_to_rpm(now.speed):.2f} rpm")
for name, value, slope in (
    ("stiffness", rig.stiffness, by.stiffness),
    ("elongation", rig.spring_elongation, by.spring_elongation),
    ("eccentricity", rig.profile.eccentricity, by.profile.eccentricity),
    ("radius", rig.profile.radius, by.profile.radius),
):
    print(f"  {name} by 1 %: {rad_s_to_rpm(value * slope) / 100:+.3f} rpm")

# the spring force is proportional to the stiffness, the float speed to its square root
stiffer = eqx.tree_at(
    lambda s: s.stiffness, rig, rig.stiffness * (wanted / now.speed) ** 2
)
assert abs(float_speed(stiffer).speed - wanted) < 1e-9 * wanted
# -

# ## A new cam
#
# The mean and the first five harmonics of the profile are free, which gives eleven
# unknowns. The highest and the lowest point of the profile are fixed (four linear
# equations). At 135 rpm the contact load must not be tensile at any of 720 angles, and
# the largest torque of the load is minimised. The constraints and their derivatives are
# compiled once.

# +
FREE = 5
angles = jnp.linspace(0.0, 2 * jnp.pi, 720, endpoint=False)
circle = rig.profile.prepared()
fine = np.linspace(0.0, 2 * np.pi, 7201)
lift = np.asarray(rig.contact_angle(jnp.asarray(fine)))
ends = jnp.asarray([fine[lift.argmax()], fine[lift.argmin()]])


def at_speed(system, speed):
    return eqx.tree_at(lambda s: s.speed, system, jnp.asarray(speed))


def with_cam(free, system=rig):
    cosines = circle.cosines.at[:FREE].set(free[:FREE])
    sines = circle.sines.at[:FREE].set(free[FREE : 2 * FREE])
    cam = FourierProfile(mean=free[2 * FREE], cosines=cosines, sines=sines)
    return eqx.tree_at(lambda s: s.profile, system, cam)


def load(free):
    return contact_load(at_speed(with_cam(free), wanted), angles)


def held(free):
    """Return the changes in lift and slope at the highest and the lowest point."""
    profile = with_cam(free).profile
    slopes = jax.vmap(jax.grad(profile))(ends)
    return jnp.concatenate([profile(ends) - circle(ends), slopes])


begin = jnp.concatenate([circle.cosines[:FREE], circle.sines[:FREE], circle.mean[None]])
load, load_slope = jax.jit(load), jax.jit(jax.jacfwd(load))
held, held_slope = jax.jit(held), jax.jit(jax.jacfwd(held))


# the last unknown is the largest torque, in N m
def below(x):
    torque = np.asarray(load(x[:-1]))
    return np.concatenate([torque, x[-1] - torque])


def below_slope(x):
    slope = np.asarray(load_slope(x[:-1]))
    count = len(slope)
    column = np.concatenate([np.zeros(count), np.ones(count)])
    return np.hstack([np.vstack([slope, -slope]), column[:, None]])


def same_slope(x):
    return np.hstack([np.asarray(held_slope(x[:-1])), np.zeros((4, 1))])


pull = np.zeros(len(begin) + 1)
pull[-1] = 1.0
found = minimize(
    lambda x: x[-1],
    np.append(begin, float(load(begin).max())),
    jac=lambda x: pull,
    constraints=[
        {"type": "ineq", "fun": below, "jac": below_slope},
        {"type": "eq", "fun": lambda x: np.asarray(held(x[:-1])), "jac": same_slope},
    ],
    options={"maxiter": 200, "ftol": 1e-10},
)
print(found.message, found.nit, "iterations")
design = with_cam(jnp.asarray(found.x[:-1]))
floats = float_speed(design).speed
print(f"the valve floats at {rad_s_to_rpm(floats):.3f} rpm")
assert abs(rad_s_to_rpm(floats) - 135.0) < 0.02
before = np.asarray(rig.contact_angle(jnp.asarray(fine)))
after = np.asarray(design.contact_angle(jnp.asarray(fine)))
print(f"lift {np.ptp(before):.6f} rad before, {np.ptp(after):.6f} rad after")
torques = {}
for name, system in (("circle", rig), ("stiffer", stiffer), ("new cam", design)):
    torque = np.asarray(contact_load(at_speed(system, wanted), jnp.asarray(fine)))
    torques[name] = torque
    print(f"{name:8} presses with {torque.min():+.4f} to {torque.max():.4f} N m")

with style():
    figure, (above, panel) = plt.subplots(
        2, 1, figsize=(6.4, 5.2), sharex=True, layout="constrained"
    )
    degrees = np.rad2deg(fine)
    lines = {
        name: panel.plot(degrees, torque, label=name)[0]
        for name, torque in torques.items()
    }
    # each cam has the same colour in both panels
    for name, lifted in (("circle", before), ("new cam", after)):
        above.plot(degrees, lifted, color=lines[name].get_color(), label=name)
    above.set_ylabel("follower angle (rad)")
    above.legend()
    panel.axhline(0.0, color="black", lw=0.8)
    panel.set(xlabel="angle of the cam (deg)", ylabel="torque at 135 rpm (N m)")
    panel.set_xticks(np.arange(0, 361, 60))
    panel.legend(loc=(0.2, 0.6))
# -

# At the same speed the load on the new cam is smaller than on the circular cam, and a
# tenth smaller than with the stiffer spring. A simulation confirms the float speed:
# permanent contact just below 135 rpm, impacts just above.

# +
for rpm in (134.5, 135.5):
    moved = at_speed(design, rpm_to_rad_s(rpm))
    run = jaxcam.simulate(moved, None, 0.0, 2 * float(moved.period))
    hits = int(run.impacts.count)
    print(f"{rpm} rpm: {hits} impacts listed in two turns")
    assert (hits > 0) == (rpm > 135.0)
# -

# ## The coefficient of restitution
#
# Above the float speed the follower has impacts, but the chatter completes in every
# revolution, until it is interrupted and chaos begins (notebook B3). The speed of this
# interruption is the root of a smooth equation, so it has a derivative with respect to
# the coefficient of restitution. A softer follower face has a lower coefficient. Which
# coefficient raises the interruption to 165 rpm? Newton's method, which uses this
# derivative, finds it.


# +
def end_of_chattering(intercept):
    softer = eqx.tree_at(lambda s: s.restitution.intercept, design, intercept)
    return variational.chatter_interruption(softer, lambda s: s.speed, bracket)


bracket = (float(rpm_to_rad_s(140.0)), float(rpm_to_rad_s(180.0)))
goal = float(rpm_to_rad_s(165.0))
intercept = design.restitution.intercept
for _ in range(5):
    end, slope = jax.jvp(end_of_chattering, (intercept,), (jnp.ones(()),))
    r = design.restitution.slope * end + intercept
    print(f"r = {r:.5f}: chatter is complete up to {rad_s_to_rpm(end):.6f} rpm")
    if abs(end - goal) < 1e-9:
        break
    intercept = intercept + (goal - end) / slope
assert abs(end - goal) < 1e-9

softer = eqx.tree_at(lambda s: s.restitution.intercept, design, intercept)
for factor, complete in ((0.999, True), (1.001, False)):
    orbit = variational.chatter_accumulation(at_speed(softer, factor * goal))
    assert bool(orbit.complete) == complete
plt.show()
