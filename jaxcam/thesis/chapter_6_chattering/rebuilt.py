"""Compute the state at the section after a deviation, by the composed map and by
simulation.
"""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational import composed_map
from variational.chatter import ComposedMap

from ...models import CamFollower
from ...plotting.colours import FLIGHT, IMPACT
from ..interruption import interruption
from ..speeds import speed_of
from ..target import Rows
from .table_6_3 import D_STAR, nearest_impact


_RANK = 37
"""Index of the late impact at which the composed map starts (docs/chatter.md)."""


class Rebuilt(NamedTuple):
    """Deviations, and the predicted and simulated states at the section, `(k, 2)`."""

    deviations: np.ndarray
    predicted: np.ndarray
    simulated: np.ndarray
    composed: ComposedMap


def composed_at(system: CamFollower, late: bool) -> tuple[CamFollower, ComposedMap]:
    """Return the rig at its interruption, and the composed map, which starts at D* or,
    if `late` is true, at a late impact.
    """
    rig = interruption(system)
    if late:
        return rig, composed_map(rig, speed_of, _RANK)
    first = composed_map(rig, speed_of, 0)
    rank = nearest_impact(rig, float(first.frame.release), D_STAR)
    return rig, composed_map(rig, speed_of, rank)


def error_of(found: Rebuilt) -> float:
    """Return the median error of the predicted velocity, relative to the range of the
    simulated velocity.
    """
    velocity = found.simulated[:, 1]
    range_ = float(np.ptp(velocity))
    return float(np.median(np.abs(found.predicted[:, 1] - velocity))) / range_


def lobe_rows(found: Rebuilt) -> Rows:
    """Return rows with the error of the prediction and the heights of the lobes."""
    return [
        ("median error over the range of the velocity", np.nan, error_of(found), ""),
        (
            "largest velocity of the lobes, simulated",
            np.nan,
            found.simulated[:, 1].max(),
            "rad/s",
        ),
        ("the same, predicted", np.nan, np.nanmax(found.predicted[:, 1]), "rad/s"),
    ]


def draw_rebuilt(found: Rebuilt, label: str, scale: float = 1.0) -> Figure:
    """Draw velocity and angle at the section, simulated and predicted."""
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 4.0))
    base = np.asarray(found.composed.relative)
    for ax, k, name in ((axes[0], 1, "velocity (rad/s)"), (axes[1], 0, "angle (rad)")):
        x = scale * found.deviations
        ax.plot(x, found.simulated[:, k] - base[k], color=FLIGHT, label="simulated")
        predicted = found.predicted[:, k] - base[k]
        ax.plot(x, predicted, "--", color=IMPACT, label="predicted")
        ax.set_ylabel(f"change of the {name}")
        ax.set_xlabel(label)
    axes[0].legend()
    return figure
