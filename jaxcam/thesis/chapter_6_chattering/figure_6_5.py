"""Figure 6.5: fixed points of f, its slopes there, and the scales of Table 5.3."""

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational import lambda_map, scaling_law

from ... import plotting
from ...models import CamFollower
from ..chapter_5_bifurcations.table_5_3 import M, Q
from ..interruption import interruption
from ..target import Rows, Target


def restitution_at(system: CamFollower) -> float:
    """Return the coefficient of restitution at the interruption."""
    rig = interruption(system)
    return float(rig.restitution(rig.speed, jnp.zeros(())))  # pyright: ignore


def compute(system: CamFollower) -> Rows:
    r = restitution_at(system)
    law = scaling_law(r)
    slope = jax.grad(lambda lam: lambda_map(lam, r))
    return [
        ("f at zero", 0.0, lambda_map(0.0, r), ""),
        ("slope of f at zero, against r", r, slope(1e-9), ""),
        ("lambda-bar", np.nan, law.lambda_bar, ""),
        (
            "f(lambda-bar) - lambda-bar",
            0.0,
            lambda_map(law.lambda_bar, r) - law.lambda_bar,
            "",
        ),
        (
            "slope at lambda-bar, against e^-M of Table 5.3",
            np.exp(-M),
            slope(law.lambda_bar),
            "",
        ),
        ("p^2, against e^Q of Table 5.3", np.exp(Q), law.p**2, ""),
        ("largest lambda followed by an impact", 3 / 8, _largest(r), ""),
    ]


def _largest(r) -> float:
    """Return the largest lambda for which the lambda-map is finite."""
    low, high = 0.34, 0.5
    for _ in range(60):
        middle = (low + high) / 2
        there = bool(jnp.isfinite(lambda_map(middle, r)))
        low, high = (middle, high) if there else (low, middle)
    return low


def draw(system: CamFollower) -> Figure:
    r = restitution_at(system)
    figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.6))
    for ax in axes:
        plotting.lambda_cobweb(r, ax)
    axes[1].set(xlim=(0, 0.22), ylim=(0, 0.22))
    axes[1].get_legend().remove()
    return figure


TARGET = Target("The scalar map of chatter", compute, draw)
