"""Figures 6.2 to 6.4: the grazing manifold, and motions that start on it."""

from typing import Any, NamedTuple, TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from variational import (
    chatter_frame,
    ChatterFrame,
    chattering_region,
    grazing_manifold,
    GrazingManifold,
    impact_map,
    ImpactCurve,
    scaling_law,
)

from ..hybrid import contact_state, simulate, Trajectory
from ..models import CamFollower
from ._chapter_1 import sticking_time
from ._chatter import (
    interruption,
)
from ._frame import frame
from ._orbits import NEAR_CAM
from ._remember import remembered


if TYPE_CHECKING:
    import pandas as pd


_NAN = float("nan")
#: impacts S^k and W^k of Figures 6.2 and 6.4
BRANCHES = {"figure-6.2": 2, "figure-6.4": 5}
_POINTS = 400
#: a start this much slower hits where rounding would let the graze be missed; the speed
#: of that impact goes with its root
_UNDER = 1 - 1e-11


class Manifold(NamedTuple):
    """What Figures 6.2 to 6.4 are made of."""

    system: CamFollower
    frame: ChatterFrame
    region: ImpactCurve
    manifold: GrazingManifold


@remembered
def manifold_of(system: CamFollower, branches: int) -> Manifold:
    """Grazing manifold and chattering region at the interruption."""
    rig = interruption(system)
    return Manifold(
        rig,
        chatter_frame(rig),
        chattering_region(rig),
        grazing_manifold(rig, branches, _POINTS),
    )


@eqx.filter_jit
def _onwards(system, time, speed):
    """Rebound speed of the next impact."""
    return jax.vmap(lambda t, u: impact_map(system, t, u)[1])(time, speed)


def manifold_table(system: CamFollower, branches: int) -> "pd.DataFrame":
    """S^1 leads to impacts without speed, and C to lambda-bar at release."""
    found = manifold_of(system, branches)
    before = found.manifold.before
    time, speed = np.asarray(before.time[0]), np.asarray(before.speed[0])
    there = np.isfinite(speed)
    after = np.asarray(_onwards(found.system, jnp.asarray(time[there]), speed[there]))
    near = found.frame.coordinate(found.region.time[0], found.region.speed[0])
    bar = scaling_law(found.frame.restitution).lambda_bar
    rows: list[tuple[str, Any, Any, str]] = [
        (
            "speed of the impact after S^1, median",
            0.0,
            np.nanmedian(np.abs(after)),
            "rad/s",
        ),
        ("lambda of C at release, beside lambda-bar", bar, near, ""),
    ]
    for k in range(branches):
        number = np.count_nonzero(np.isfinite(np.asarray(before.speed[k])))
        share = number / before.speed.shape[1]
        rows.append((f"part of the grazes that S^{k + 1} leads to", _NAN, share, ""))
    return frame(rows)


def figure_6_2(system: CamFollower) -> "pd.DataFrame":
    """Figure 6.2: the first branches of the grazing manifold, for the rig."""
    return manifold_table(system, BRANCHES["figure-6.2"])


def figure_6_4(system: CamFollower) -> "pd.DataFrame":
    """Figure 6.4: more branches of it."""
    return manifold_table(system, BRANCHES["figure-6.4"])


class Series(NamedTuple):
    """A motion of Figure 6.3, from an impact of the plane of Figure 6.2."""

    name: str
    time: float
    speed: float
    #: time of the graze, or of release
    until: float
    run: Trajectory


@remembered
def series(system: CamFollower) -> list[Series]:
    """Motions from S^1 and to either side of it, from S^2, from C and from inside D."""
    found = manifold_of(system, BRANCHES["figure-6.2"])
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
        starts.append((f"{name}: ends in a graze", *start))
    _, time, speed, until = starts[0]
    starts.insert(0, ("slower than S$^1$: an impact more", time, 0.97 * speed, until))
    starts.insert(2, ("faster than S$^1$: an impact less", time, 1.03 * speed, until))
    there = np.flatnonzero(np.isfinite(np.asarray(region.speed)))
    far = there[-len(there) // 8]
    time, speed = float(region.time[far]), float(region.speed[far])
    release = float(found.frame.release)
    starts.append(("C: accumulates at release", time, speed, release))
    starts.append(("inside D: rests before release", time, 0.6 * speed, release))
    made = []
    prepared = rig.prepared()
    for name, time, speed, until in starts:
        state = contact_state(prepared, jnp.asarray([time]), jnp.array(NEAR_CAM))[0]
        state = state.at[1].add(float(speed))
        run = simulate(rig, state, float(time), float(time) + 0.8 * float(rig.period))
        made.append(Series(name, time, speed, until, run))
    return made


def figure_6_3(system: CamFollower) -> "pd.DataFrame":
    """Figure 6.3: S^1 and S^2 end in impacts without speed; what follows others."""
    rows: list[tuple[str, Any, Any, str]] = []
    rig = manifold_of(system, BRANCHES["figure-6.2"]).system
    for one in series(system):
        name = one.name.replace("$", "")
        if name.startswith("S^"):
            time, speed = jnp.asarray(one.time), jnp.asarray(one.speed) * _UNDER
            for _ in range(int(name[2])):
                time, speed = impact_map(rig, time, speed)
            rows.append((f"{name}: speed of that impact", 0.0, speed, "rad/s"))
        count = len(np.asarray(one.run.impacts.time))
        rows.append((f"{name}: impacts listed", _NAN, count, ""))
        rows.append((f"{name}: sticking time", _NAN, sticking_time(one.run), "s"))
    return frame(rows)
