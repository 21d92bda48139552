"""Figures 3.8 and 3.11: a discontinuous periodic orbit, its branch, its flow."""

from typing import NamedTuple, TYPE_CHECKING

import jax.numpy as jnp
import numpy as np

from ..fitting import SpecialPoint
from ..hybrid import simulate, Trajectory
from ..models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ._frame import frame
from ._orbits import (
    along_traces,
    at_speed,
    first_orbit,
    FLIP,
    FOLD,
    monodromy_of,
    multipliers_of,
    next_orbit,
    orbit_at,
    point_on_line,
    SEARCH,
)
from ._printed import FLIP_SPEED, FOLD_SPEED, TRACES
from ._remember import remembered


if TYPE_CHECKING:
    import pandas as pd


#: speed at which the orbit is drawn (rpm)
SPEED = 147.941373499943
_RANGE = (138.0, 153.5)
#: points below that, and how far the sum of the multipliers goes beyond the fold's
_NEAR_FOLD, _BEYOND = 12, 0.1


class SmoothBranch(NamedTuple):
    """The P(1,1) branch of a rig, from the saddles behind its fold on."""

    #: (k,) rpm
    speed: np.ndarray
    #: (k,) angle of the follower at its impact (rad)
    angle: np.ndarray
    #: (k, 2)
    multipliers: np.ndarray
    fold: float
    flip: float


@remembered
def smooth_branch(system: CamFollower, points: int = 16) -> SmoothBranch:
    """Orbits, multipliers, fold and flip; NaN where the rig has no such orbit."""
    start = first_orbit(system)
    speeds = np.linspace(*_RANGE, points)
    if start is None:
        lost = np.full(points, np.nan)
        return SmoothBranch(speeds, lost, np.full((points, 2), np.nan), np.nan, np.nan)
    angles, values = np.zeros(points), np.zeros((points, 2), dtype=complex)
    # both ways from where the orbit is known, each from its neighbour
    middle = int(np.argmin(np.abs(speeds - SEARCH)))
    orbit = start
    for walk in (range(middle, points), range(middle - 1, -1, -1)):
        orbit = orbit_at(system, start, speeds[walk[0]])
        for k in walk:
            rig = at_speed(system, speeds[k])
            orbit = next_orbit(rig, orbit)
            angles[k] = float(orbit.states[0, 0])
            values[k] = multipliers_of(monodromy_of(rig, orbit))
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
    """Speed (rpm), angle and multipliers of orbits from `rpm` through the fold.

    Around it the sum of the multipliers goes on, where the speed turns back.
    """
    point = SpecialPoint(jnp.asarray(rpm_to_rad_s(rpm)), orbit)
    matrix = np.asarray(monodromy_of(at_speed(system, rpm), orbit))
    end = 1 + np.linalg.det(matrix) + _BEYOND
    for value in np.linspace(np.trace(matrix), end, _NEAR_FOLD + 1)[1:]:
        point = point_on_line(system, point, (float(value), 0.0))
        rig = at_speed(system, rad_s_to_rpm(point.parameter))
        values = multipliers_of(monodromy_of(rig, point.orbit))
        yield (
            float(rad_s_to_rpm(point.parameter)),
            float(point.orbit.states[0, 0]),
            values,
        )


@remembered
def periodic_run(system: CamFollower, turns: float = 2.0) -> Trajectory:
    """The P(1,1) orbit of Figures 3.8 (a) and 3.11, from half a turn after an impact.

    **Raises:** `ValueError` where the rig has no such orbit.
    """
    start = first_orbit(system)
    if start is None:
        raise ValueError("This rig has no P(1,1) orbit near 148 rpm; choose another.")
    rig = at_speed(system, SPEED)
    orbit = orbit_at(system, start, SPEED)
    period = float(rig.period)
    # half a turn on it is in flight
    time = float(orbit.times[0]) + period / 2
    state = simulate(rig, orbit.states[0], time - period / 2, time).final
    return simulate(rig, state, time, time + turns * period)


def figure_3_8(system: CamFollower) -> "pd.DataFrame":
    """Figure 3.8: where the branch folds and doubles, and its multipliers between."""
    branch = smooth_branch(system)
    size = np.max(np.abs(branch.multipliers), axis=1)
    inside = branch.speed[size < 1]
    rows = [
        ("fold", FOLD_SPEED, branch.fold, "rpm"),
        ("first flip", FLIP_SPEED, branch.flip, "rpm"),
        ("last speed with both multipliers inside", np.nan, inside.max(), "rpm")
        if len(inside)
        else ("last speed with both multipliers inside", np.nan, np.nan, "rpm"),
    ]
    return frame(rows)


def figure_3_11(system: CamFollower) -> "pd.DataFrame":
    """Figure 3.11: the two jumps of the flow, of the velocity and of the phase."""
    run = periodic_run(system)
    before, after = np.asarray(run.impacts.before), np.asarray(run.impacts.after)
    jump = after[0, 1] - before[0, 1]
    back = np.max(np.abs(np.asarray(run.final - run.steps.state[0])))
    return frame(
        [
            ("jump of the velocity at the impact", np.nan, jump, "rad/s"),
            ("jump of the angle there", 0.0, after[0, 0] - before[0, 0], "rad"),
            ("closing of the orbit after two turns", 0.0, back, ""),
            ("impacts in two turns", 2, len(before), ""),
        ]
    )
