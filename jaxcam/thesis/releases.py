"""Simulate cycles from the release of a sticking orbit, to see whether the follower
sticks again.
"""

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ..hybrid import simulate, Trajectory
from ..hybrid.programs import program
from ..hybrid.surface import release_point
from ..models import CamFollower, rpm_to_rad_s
from .motion_drawing import draw_gap
from .progress import counted
from .speeds import at_speed
from .target import Rows, Target


_LOOKS = 8
"""Number of times in a period at which the search for a release starts."""


def released_turn(system: CamFollower, rpm: float) -> Trajectory:
    """Simulate 1.1 turns from the release of a sticking orbit."""
    rig = at_speed(system, rpm_to_rad_s(rpm))
    # a rig with another phase may be in contact at time zero, so try later times too
    times = float(rig.period) / _LOOKS * np.arange(_LOOKS)
    found = [_release(rig, time) for time in times]
    release = next((one for one in found if float(one.holds) == 0), found[0])
    start = float(release.time)
    return simulate(rig, release.state, start, start + 1.1 * float(rig.period))


@program
def _release(system, time):
    return release_point(system, jnp.asarray(time))


def sticking_time(run: Trajectory) -> float:
    """Return the total contact time in a run (s), except for contact at its very
    start.
    """
    contacts = run.contacts
    later = np.asarray(contacts.start) > float(run.t0)
    return float(np.sum((np.asarray(contacts.end) - np.asarray(contacts.start))[later]))


def draw_turn(run: Trajectory, ax, label: str, colour: str, dashes="solid") -> None:
    """Draw the gap against the time from release."""
    times = np.linspace(float(run.t0), float(run.t1), 1500)
    gap = np.asarray(run.gap(times))
    ax.plot(times - times[0], gap, color=colour, ls=dashes, lw=1.2, label=label)
    ax.set_xlabel("time from release (s)")
    ax.set_ylabel("gap (rad)")


def released_target(title: str, *cases: tuple[float, float], note: str = "") -> Target:
    """Create the target for a figure of one turn from release at several speeds.

    **Arguments:** `cases`: speed (rpm), and whether the motion sticks: 1, 0, or NaN if
    the thesis does not say.
    """

    def compute(system: CamFollower) -> Rows:
        rows: Rows = []
        for rpm, printed in counted("simulating a cycle from release", cases):
            run = released_turn(system, rpm)
            time = sticking_time(run)
            rests = float(time > 0)
            never = 0 if printed == 0 else np.nan
            rows += [
                (
                    f"{rpm:g} rpm: contact intervals in the turn from release",
                    printed,
                    rests,
                    "",
                ),
                (f"{rpm:g} rpm: sticking time", never, time, "s"),
            ]
        return rows

    return Target(title, compute, lambda system: _draw(system, cases), note=note)


def _draw(system: CamFollower, cases) -> Figure:
    """Draw the gap in the turn after a release: one row of panels for each speed."""
    figure, axes = plt.subplots(len(cases), 2, figsize=(9.6, 2.4 * len(cases)))
    for (left, right), (rpm, _) in zip(axes, cases, strict=True):
        run = released_turn(system, rpm)
        words = "complete" if sticking_time(run) > 0 else "interrupted"
        for ax in (left, right):
            draw_gap(ax, run)
        left.set_title(f"{rpm:g} rpm: {words}")
        period = 60 / rpm
        start = float(run.t0)
        ends = start + period * np.array([0.88, 1.02])
        near = np.max(np.asarray(run.gap(np.linspace(ends[0], ends[1], 400))))
        right.set_xlim(*ends)
        right.set_ylim(-0.05 * near, 1.1 * near)
        right.axvline(start + period, color="0.5", ls=":", lw=1.2)
        right.set_ylabel("")
    axes[0, 1].set_title("up to the next release")
    for ax in axes[-1]:
        ax.set_xlabel("time (s)")
    return figure
