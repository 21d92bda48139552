"""A small circle of initial states becomes an ellipse at an impact: the dots are
simulated, and the line follows from the saltation matrix."""

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import jaxcam
import variational
from jaxcam.hybrid import flow
from jaxcam.models import ImpactOscillator
from jaxcam.plotting import style
from jaxcam.plotting.colours import FLIGHT, IMPACT


system = ImpactOscillator(omega=2.0, restitution=0.7, wall=0.5, damping=0.0)
start, radius = jnp.array([0.2, 1.0]), 1e-3
hit = jaxcam.simulate(system, start, 0.0, 1.0).impacts
end = float(hit.time[0]) + 0.01

angle = np.linspace(0, 2 * np.pi, 49)
circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
after = jax.vmap(lambda x: flow(system, x, 0.0, end).state)(start + circle)
there = flow(system, start, 0.0, end).state

# the final perturbations to first order: flight, saltation matrix, flight
ball = ImpactOscillator(omega=2.0, restitution=0.7, wall=9.0, damping=0.0)
fly = jax.jacfwd(lambda x, t0, t1: flow(ball, x, t0, t1).state)
time = float(hit.time[0])
saltation = variational.saltation_matrix(system, time, hit.before[0])
linear = fly(hit.after[0], time, end) @ saltation @ fly(start, 0.0, time)
ellipse = circle @ np.asarray(linear).T

with style():
    figure, ax = plt.subplots(figsize=(6.0, 4.8))
    ax.plot(*(1e3 * circle.T), color=FLIGHT, label="before")
    ax.plot(*(1e3 * ellipse.T), color=IMPACT, label="after: saltation matrix")
    ax.plot(*(1e3 * (after - there).T), ".", color=IMPACT, ms=8, label="simulated")
    ax.set_xlabel("deviation of the position (10⁻³)")
    ax.set_ylabel("deviation of the velocity (10⁻³)")
    ax.set_aspect("equal")
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, columnspacing=1.0)
