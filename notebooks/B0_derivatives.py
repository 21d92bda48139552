# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # B0. Simulate and differentiate
#
# A trajectory can be differentiated through all of its events: an impact, the
# infinitely many impacts of complete chatter, the sticking that follows, and the
# release. This notebook covers these events one after another, compares each derivative
# with a formula or a finite difference, and ends with a batch.

# +
import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import jaxcam
from jaxcam.hybrid import flow
from jaxcam.models import BouncingBall, CamFollower, rpm_to_rad_s
from jaxcam.plotting import style, time_history


# -

# ## Differentiate through one impact and through chatter
#
# A ball falls from a height of one metre, bounces ever more rapidly, and comes to rest
# after a finite time. Stronger gravity makes the first impact earlier and faster, and
# both effects change the height at 0.7 s. `jax.jacfwd` of `simulate` includes both,
# because it also differentiates the time of the impact. With $t_1 = \sqrt{2h/g}$ and
# the coefficient of restitution $r$,
#
# $$y(t) = r g t_1 (t - t_1) - \tfrac12 g (t - t_1)^2, \qquad
#   t_\infty = t_1 \frac{1 + r}{1 - r}.$$
#
# About sixty of the infinitely many impacts are simulated, and the others are summed in
# closed form. The derivative of the time at which the ball comes to rest includes all
# of them.

# +
start, when = jnp.array([1.0, 0.0]), 0.7


def outcome(parameters):
    gravity, restitution = parameters
    ball = BouncingBall(gravity=gravity, restitution=restitution)
    run = jaxcam.simulate(ball, start, 0.0, 8.0, max_steps=512)
    height = run.at(jnp.array([when]))[0, 0]
    return jnp.stack([height, run.contacts.start[0]])


def by_formula(parameters):
    g, r = parameters
    fall = jnp.sqrt(2.0 * start[0] / g)
    flown = when - fall
    height = r * g * fall * flown - g * flown**2 / 2
    return jnp.stack([height, fall * (1 + r) / (1 - r)])


ball = jnp.array([9.81, 0.8])
forward = jax.jit(jax.jacfwd(outcome))(ball)
exact = jax.jacfwd(by_formula)(ball)
print("d height / d (gravity, restitution):", forward[0], "formula:", exact[0])
print("d start of rest / d (gravity, restitution):", forward[1], "formula:", exact[1])
assert jnp.allclose(forward, exact, rtol=1e-9)
# -

# `jax.jvp` differentiates in a single direction and costs less; the batch at the end
# uses it. `jax.grad` and `jax.hessian` work as well, in forward mode. For one scalar
# result and hundreds of parameters use reverse mode: pass `derivatives="reverse"` to
# `simulate`, and keep `max_steps` small, because that many steps are always performed.

# +


@jax.jit
@jax.grad
def backward(parameters):
    gravity, restitution = parameters
    ball = BouncingBall(gravity=gravity, restitution=restitution)
    run = jaxcam.simulate(ball, start, 0.0, when, max_steps=32, derivatives="reverse")
    return run.final[0]


assert jnp.allclose(backward(ball), exact[0], rtol=1e-9)
# -

# ## Differentiate through sticking and a release
#
# At 130 rpm the follower detaches from its cam once per revolution, chatters, and
# sticks again. While it sticks, the cam alone determines its motion.

# +
rig = CamFollower(speed=jnp.asarray(rpm_to_rad_s(130.0)))
turn = jaxcam.simulate(rig, None, 0.0, 2 * float(rig.period))
contacts = turn.contacts
for begin, end in zip(contacts.start, contacts.end):
    print(f"in contact from {begin:.4f} to {end:.4f} s")
figure = time_history(turn, components=(0,))
# -

# The state in the second flight therefore does not depend on the state one revolution
# earlier, in the first flight, but it does depend on the stiffness of the spring. One
# simulation gives the two derivatives; a central difference of two simulations confirms
# the derivative with respect to the stiffness.

# +
# after a third of the first flight, and one revolution later
first = float(contacts.end[0] + (contacts.start[1] - contacts.end[0]) / 3)
before = turn.at(jnp.array([first]))[0]


@jax.jit
def one_turn(state, stiffness):
    moved = eqx.tree_at(lambda s: s.stiffness, rig, stiffness)
    return flow(moved, state, first, first + rig.period).state


by_state, by_stiffness = jax.jit(jax.jacfwd(one_turn, argnums=(0, 1)))(
    before, rig.stiffness
)
step = 1e-4
difference = (
    one_turn(before, rig.stiffness + step) - one_turn(before, rig.stiffness - step)
) / (2 * step)
print("d state / d state one revolution earlier:", by_state.tolist())
print("d state / d stiffness:", by_stiffness, " finite difference:", difference)
assert abs(by_state).max() < 1e-12 and abs(by_stiffness).min() > 1e-5
assert jnp.allclose(by_stiffness, difference, rtol=1e-4)
# -

# ## A batch of simulations
#
# `jax.vmap` runs many simulations as one program; each batch element may have its own
# sequence of impacts and contacts. We drop the ball from 300 heights onto a vibrating
# floor, and compute the velocity after one second and its derivative with respect to
# the height.

# +
shaken = BouncingBall(amplitude=jnp.asarray(0.02), frequency=jnp.asarray(20.0))


def later(drop):
    arrived = flow(shaken, jnp.stack([drop, 0.0]), 0.0, 1.0, max_steps=512)
    return arrived.state[1], arrived.impacts


@jax.jit
@jax.vmap
def with_slope(drop):
    (velocity, impacts), (slope, _) = jax.jvp(later, (drop,), (jnp.ones(()),))
    return velocity, slope, impacts


drops = jnp.linspace(0.25, 1.0, 300)
velocity, slope, impacts = map(np.asarray, with_slope(drops))

with style():
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(6.4, 4.6), sharex=True, layout="constrained"
    )
    for number in np.unique(impacts):
        one = np.where(impacts == number, 1.0, np.nan)
        above.plot(drops, velocity * one, label=f"{int(number)} impact(s)")
        below.plot(drops, slope * one)
    above.set_ylabel("velocity after 1 s (m/s)")
    above.legend(loc="best")
    below.set_ylabel("derivative (1/s)")
    below.set_xlabel("height of the drop (m)")
# -

# Each colour stands for a number of impacts. Within a colour, the lower curve is the
# slope of the upper one. From one colour to the next the velocity jumps, because one
# more impact occurs within the second. No derivative describes such a jump, and a
# finite difference across it is meaningless. (Balls dropped from lower heights have
# tens of impacts, and their derivatives are in the hundreds.)

# +
# away from the jumps: central differences of the curve, compared with the derivative
same = (impacts[2:] == impacts[1:-1]) & (impacts[1:-1] == impacts[:-2])
quotient = (velocity[2:] - velocity[:-2]) / np.asarray(drops[2:] - drops[:-2])
error = np.abs(quotient - slope[1:-1])[same]
print(f"{same.sum()} points, largest difference {error.max():.4f} 1/s")
assert same.sum() > 250 and error.max() < 0.2
plt.show()
