"""Figure 3.12: the branch of P(1,1) continues around its fold."""

from typing import TYPE_CHECKING

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ... import plotting
from ...models import CamFollower, rad_s_to_rpm
from ..chapter_5_bifurcations.figure_5_14 import A
from ..chapter_5_bifurcations.table_5_2 import FLIP_SPEED, FOLD_SPEED
from ..progress import of_branch
from ..remember import remembered
from ..speeds import at_rpm, speed_of
from ..target import Rows, Target
from .branches import bounds, special_speed, START_RPM


if TYPE_CHECKING:
    from continuation import Branch


_HITTING = 130.0, 154.0
"""Bounds of the branch (rpm)."""


@remembered
def hitting_branch(system: CamFollower) -> "Branch":
    """Follow P(1,1) around its fold and past its flip."""
    import continuation

    start = continuation.periodic_orbits(
        at_rpm(system, START_RPM), jnp.array(A), periods=1
    )
    return continuation.branch(
        start.problem,
        start,
        speed_of,
        bounds(_HITTING),
        direction="both",
        callbacks=[of_branch(*_HITTING)],
    )


def compute(system: CamFollower) -> Rows:
    branch = hitting_branch(system)
    fold = special_speed(branch, "fold")
    unstable = [p for p in branch.regular if p.stable is not None and not p.stable]
    beyond = [p.parameter for p in unstable if np.max(np.real(p.multipliers)) > 1]
    highest = float(rad_s_to_rpm(max(beyond))) if beyond else np.nan
    return [
        ("fold", FOLD_SPEED, fold, "rpm"),
        ("first flip", FLIP_SPEED, special_speed(branch, "flip"), "rpm"),
        ("saddles followed beyond the fold, to", np.nan, highest, "rpm"),
        ("orbits on the branch", np.nan, len(branch.regular), ""),
    ]


def draw(system: CamFollower) -> Figure:
    branch = hitting_branch(system)
    figure, ax = plt.subplots(figsize=(7.6, 4.8))
    plotting.branch_diagram(
        branch, ax, x_label=("speed", "rpm"), y_label=("angle", "rad"),
        x_scale=30 / np.pi,
    )  # fmt: skip
    return figure


TARGET = Target("The P(1,1) branch around its fold", compute, draw)
