"""The grazing manifold and the chatter region, drawn in Figures 6.2 and 6.4."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational import (
    chatter_frame,
    chattering_region,
    grazing_manifold,
    impact_map,
    scaling_law,
)
from variational.chatter import ChatterFrame, GrazingManifold, ImpactCurve

from ... import plotting
from ...hybrid.programs import program
from ...models import CamFollower
from ..interruption import interruption
from ..remember import remembered
from ..target import Rows


_POINTS = 400


class Manifold(NamedTuple):
    """The data of Figures 6.2 to 6.4."""

    system: CamFollower
    frame: ChatterFrame
    region: ImpactCurve
    manifold: GrazingManifold


@remembered
def manifold_of(system: CamFollower, branches: int) -> Manifold:
    """Return the grazing manifold and the chatter region at the interruption."""
    rig = interruption(system)
    return Manifold(
        rig,
        chatter_frame(rig),
        chattering_region(rig),
        grazing_manifold(rig, branches, _POINTS),
    )


@program
def _onwards(system, time, speed):
    """Return the rebound speed of the next impact."""
    return jax.vmap(lambda t, u: impact_map(system, t, u)[1])(time, speed)


def manifold_rows(system: CamFollower, branches: int) -> Rows:
    """Return rows that check two curves: S^1, whose next impact has zero speed, and C,
    on which lambda is lambda-bar at the release.
    """
    found = manifold_of(system, branches)
    before = found.manifold.before
    time, speed = np.asarray(before.time[0]), np.asarray(before.speed[0])
    there = np.isfinite(speed)
    after = np.asarray(_onwards(found.system, jnp.asarray(time[there]), speed[there]))
    near = found.frame.coordinate(found.region.time[0], found.region.speed[0])
    bar = scaling_law(found.frame.restitution).lambda_bar
    rows: Rows = [
        (
            "speed of the impact after S^1, median",
            0.0,
            np.nanmedian(np.abs(after)),
            "rad/s",
        ),
        ("lambda of C at release, against lambda-bar", bar, near, ""),
    ]
    for k in range(branches):
        number = np.count_nonzero(np.isfinite(np.asarray(before.speed[k])))
        share = number / before.speed.shape[1]
        rows.append(
            (
                f"fraction of the grazing points reached from S^{k + 1}",
                np.nan,
                share,
                "",
            )
        )
    return rows


def draw_manifold(found: Manifold, most: float | None) -> Figure:
    """Draw the manifold and the region in the plane of time and rebound speed, up to
    `most`.
    """
    figure, ax = plt.subplots(figsize=(7.8, 5.2))
    period = float(found.system.period)
    plotting.chattering_picture(
        found.frame, found.region, found.manifold, ax, period=period, most=most
    )
    ax.set_ylabel("rebound speed (rad/s)")
    return figure
