"""Figure 4.15: restitution against speed, compared with the values that Table 5.2
implies.

The thesis does not print the line itself; the product of the two multipliers of an
orbit with one impact is r^2.
"""

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...models import CamFollower, rpm_to_rad_s
from ...plotting.colours import FLIGHT, SECOND
from ..chapter_5_bifurcations.table_5_2 import PRODUCTS, SPEEDS
from ..target import Rows, Target


def compute(system: CamFollower) -> Rows:
    rows = []
    for rpm, product in zip(SPEEDS, PRODUCTS, strict=True):
        law = system.restitution(rpm_to_rad_s(rpm), jnp.zeros(()))  # pyright: ignore
        rows.append((f"r at {rpm:.6f} rpm", np.sqrt(product), law, ""))
    return rows


def draw(system: CamFollower) -> Figure:
    figure, ax = plt.subplots()
    rpm = np.linspace(130, 155, 100)
    r = [system.restitution(rpm_to_rad_s(s), jnp.zeros(())) for s in rpm]  # pyright: ignore
    ax.plot(rpm, np.asarray(r), color=FLIGHT, label="this rig")
    printed = np.sqrt(PRODUCTS)
    ax.plot(SPEEDS, printed, "*", color=SECOND, label="from Table 5.2")
    ax.set_xlabel("speed (rpm)")
    ax.set_ylabel("coefficient of restitution (–)")
    ax.legend()
    return figure


TARGET = Target("Restitution against speed", compute, draw)
