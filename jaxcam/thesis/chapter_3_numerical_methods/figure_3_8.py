"""Figure 3.8: fold and flip of the P(1,1) branch, and its multipliers in between."""

from typing import NamedTuple

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational.orbits import SpecialPoint

from ... import plotting
from ...models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ...plotting.colours import FLIGHT, SECOND
from ..chapter_5_bifurcations.table_5_2 import FLIP_SPEED, FOLD_SPEED, TRACES
from ..orbits import (
    along_traces,
    compiled_monodromy,
    first_orbit,
    FLIP,
    FOLD,
    next_orbit,
    orbit_at,
    ordered_multipliers,
    point_on_line,
    SEARCH,
)
from ..progress import counted
from ..remember import remembered
from ..speeds import at_rpm
from ..target import Rows, Target
from .figure_3_11 import periodic_run


_RANGE = (138.0, 153.5)
_NEAR_FOLD, _BEYOND = 12, 0.1
"""Number of points computed around the fold, and amount by which the sum of the
multipliers at the last of them exceeds its value at the fold.
"""


class SmoothBranch(NamedTuple):
    """The P(1,1) branch of a rig, including the saddles beyond its fold."""

    speed: np.ndarray
    """Speeds (rpm), shape `(k,)`."""
    angle: np.ndarray
    """Angles of the follower at its impact (rad), shape `(k,)`."""
    multipliers: np.ndarray
    """The two multipliers of each orbit, shape `(k, 2)`."""
    fold: float
    flip: float


@remembered
def smooth_branch(system: CamFollower, points: int = 16) -> SmoothBranch:
    """Compute orbits, multipliers, fold and flip; NaN if the rig has no such orbit."""
    start = first_orbit(system)
    speeds = np.linspace(*_RANGE, points)
    if start is None:
        lost = np.full(points, np.nan)
        return SmoothBranch(speeds, lost, np.full((points, 2), np.nan), np.nan, np.nan)
    angles, values = np.zeros(points), np.zeros((points, 2), dtype=complex)
    # follow the branch in both directions from the known orbit
    middle = int(np.argmin(np.abs(speeds - SEARCH)))
    orbit = start
    for walk in (range(middle, points), range(middle - 1, -1, -1)):
        orbit = orbit_at(system, start, speeds[walk[0]])
        for k in counted("following an orbit from its neighbour", walk):
            rig = at_rpm(system, speeds[k])
            orbit = next_orbit(rig, orbit)
            angles[k] = float(orbit.states[0, 0])
            values[k] = ordered_multipliers(compiled_monodromy(rig, orbit))
        below = list(_around_the_fold(system, orbit, speeds[0]))[::-1]
    speeds = np.concatenate([[row[0] for row in below], speeds])
    angles = np.concatenate([[row[1] for row in below], angles])
    values = np.concatenate([[row[2] for row in below], values])
    near = along_traces(system, start, TRACES[0])
    fold = float(rad_s_to_rpm(point_on_line(system, near, FOLD).parameter))
    near = along_traces(system, start, TRACES[-2])
    flip = float(rad_s_to_rpm(point_on_line(system, near, FLIP).parameter))
    return SmoothBranch(speeds, angles, values, fold, flip)


def _around_the_fold(system: CamFollower, orbit, rpm: float):
    """Yield speed (rpm), angle and multipliers of orbits from `rpm` around the fold.

    Around the fold the sum of the multipliers is monotonic, whereas the speed is not.
    """
    point = SpecialPoint(jnp.asarray(rpm_to_rad_s(rpm)), orbit)
    matrix = np.asarray(compiled_monodromy(at_rpm(system, rpm), orbit))
    end = 1 + np.linalg.det(matrix) + _BEYOND
    for value in np.linspace(np.trace(matrix), end, _NEAR_FOLD + 1)[1:]:
        point = point_on_line(system, point, (float(value), 0.0))
        rig = at_rpm(system, rad_s_to_rpm(point.parameter))
        values = ordered_multipliers(compiled_monodromy(rig, point.orbit))
        yield (
            float(rad_s_to_rpm(point.parameter)),
            float(point.orbit.states[0, 0]),
            values,
        )


def compute(system: CamFollower) -> Rows:
    branch = smooth_branch(system)
    size = np.max(np.abs(branch.multipliers), axis=1)
    inside = branch.speed[size < 1]
    rows = [
        ("fold", FOLD_SPEED, branch.fold, "rpm"),
        ("first flip", FLIP_SPEED, branch.flip, "rpm"),
        (
            "highest speed with both multipliers inside the unit circle",
            np.nan,
            inside.max(),
            "rpm",
        )
        if len(inside)
        else (
            "highest speed with both multipliers inside the unit circle",
            np.nan,
            np.nan,
            "rpm",
        ),
    ]
    return rows


def draw(system: CamFollower) -> Figure:
    branch = smooth_branch(system)
    run = periodic_run(system, 1.0)
    figure, axes = plt.subplots(1, 3, figsize=(12, 4))
    plotting.phase_portrait(run, axes[0])
    plotting.multipliers(branch.multipliers, axes[1])
    stable = np.max(np.abs(branch.multipliers), axis=1) < 1
    axes[2].plot(branch.speed, branch.angle, "--", color=FLIGHT, lw=1.2)
    angle = np.where(stable, branch.angle, np.nan)
    axes[2].plot(branch.speed, angle, "o-", ms=3, color=FLIGHT)
    for speed, word in ((branch.fold, "fold"), (branch.flip, "flip")):
        axes[2].axvline(speed, color=SECOND, lw=0.9)
        axes[2].text(
            speed, 1.01, word, ha="center", transform=axes[2].get_xaxis_transform()
        )
    axes[2].set_xlabel("speed (rpm)")
    axes[2].set_ylabel("angle at impact (rad)")
    return figure


TARGET = Target("The P(1,1) orbit and its branch", compute, draw)
