"""Figure 6.3: motions from S^1 and S^2 to grazing impacts, and neighbouring motions."""

from typing import NamedTuple

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational import impact_map

from ...hybrid import simulate, Trajectory
from ...hybrid.surface import contact_state
from ...models import CamFollower
from ...plotting.colours import FLIGHT, IMPACT, RECORDED
from ...plotting.curves import trajectory_curve
from ..orbits import NEAR_CAM
from ..releases import sticking_time
from ..remember import remembered
from ..target import Rows, Target
from .figure_6_2 import BRANCHES
from .manifold import manifold_of


_UNDER = 1 - 1e-11
"""Reduction of the initial speed that turns grazing into an impact well above rounding
error; the impact speed grows with the square root of the reduction.
"""


class Series(NamedTuple):
    """A motion of Figure 6.3; it starts with an impact in the plane of Figure 6.2."""

    name: str
    time: float
    speed: float
    until: float
    """Time of grazing or of the release."""
    run: Trajectory


@remembered
def series(system: CamFollower) -> list[Series]:
    """Compute motions that start on the curve S^1, on both sides of it, on S^2, on C,
    and inside the region D.
    """
    found = manifold_of(system, BRANCHES)
    rig, before, region = found.system, found.manifold.before, found.region
    starts = []
    for k, name in ((0, "S$^1$"), (1, "S$^2$")):
        times, speeds = np.asarray(before.time[k]), np.asarray(before.speed[k])
        there = np.flatnonzero(np.isfinite(speeds))
        middle = there[len(there) // 2]
        time, speed = jnp.asarray(times[middle]), jnp.asarray(speeds[middle])
        speed = speed * _UNDER
        for _ in range(k + 1):
            time, speed = impact_map(rig, time, speed)
        start = (float(times[middle]), float(speeds[middle]), float(time))
        starts.append((f"{name}: ends in grazing", *start))
    _, time, speed, until = starts[0]
    starts.insert(0, ("slower than S$^1$: one more impact", time, 0.97 * speed, until))
    starts.insert(2, ("faster than S$^1$: one impact fewer", time, 1.03 * speed, until))
    there = np.flatnonzero(np.isfinite(np.asarray(region.speed)))
    far = there[-len(there) // 8]
    time, speed = float(region.time[far]), float(region.speed[far])
    release = float(found.frame.release)
    starts.append(("C: accumulates at release", time, speed, release))
    starts.append(("inside D: sticks before release", time, 0.6 * speed, release))
    made = []
    prepared = rig.prepared()
    for name, time, speed, until in starts:
        state = contact_state(prepared, jnp.asarray([time]), jnp.array(NEAR_CAM))[0]
        state = state.at[1].add(float(speed))
        run = simulate(rig, state, float(time), float(time) + 0.8 * float(rig.period))
        made.append(Series(name, time, speed, until, run))
    return made


def compute(system: CamFollower) -> Rows:
    rows: Rows = []
    rig = manifold_of(system, BRANCHES).system
    for one in series(system):
        name = one.name.replace("$", "")
        if name.startswith("S^"):
            time, speed = jnp.asarray(one.time), jnp.asarray(one.speed) * _UNDER
            for _ in range(int(name[2])):
                time, speed = impact_map(rig, time, speed)
            rows.append((f"{name}: speed of the grazing impact", 0.0, speed, "rad/s"))
        count = len(np.asarray(one.run.impacts.time))
        rows.append((f"{name}: impacts listed", np.nan, count, ""))
        rows.append((f"{name}: sticking time", np.nan, sticking_time(one.run), "s"))
    return rows


def draw(system: CamFollower) -> Figure:
    motions = series(system)
    figure, axes = plt.subplots(3, 2, figsize=(9.6, 7.2))
    for ax, one in zip(axes.flat, motions, strict=True):
        drawn = trajectory_curve(one.run, None, 3000)
        start = float(one.run.t0)
        ax.plot(drawn.time - start, drawn.gap[:, 0], color=FLIGHT, lw=1.2)
        hit = drawn.impact_time - start
        ax.plot(hit, np.zeros_like(hit), ".", color=IMPACT, ms=5)
        ax.axhline(0, color="0.4", lw=0.7)
        ax.set_title(one.name, fontsize=11)
        # the long flight after grazing would make the rest too small to be seen
        last = 1.25 * (one.until - start)
        near = drawn.time - start <= one.until - start
        top = 1.25 * np.nanmax(drawn.gap[near])
        ax.set_xlim(0, last)
        ax.set_ylim(-0.08 * top, top)
        ax.axvline(one.until - start, color=RECORDED, ls=":", lw=1.2)
    for ax in axes[-1]:
        ax.set_xlabel("time (s)")
    for ax in axes[:, 0]:
        ax.set_ylabel("gap (rad)")
    return figure


TARGET = Target("Motions from the grazing manifold", compute, draw)
