"""Figures 1.2 and 1.3: a periodic orbit with chatter, complete and interrupted."""

from typing import Any, TYPE_CHECKING

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..hybrid import release_point, simulate, Trajectory
from ..models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ._chatter import at_speed, beside_interruption, INTERRUPTION, interruption
from ._frame import frame


if TYPE_CHECKING:
    import pandas as pd


#: printed speeds of Figure 1.3 (rpm), either side of the interruption
_COMPLETE, _INTERRUPTED = 152.65, 152.69
#: times in a period at which a release is asked for
_LOOKS = 8
_NAN = float("nan")


def both_sides(system: CamFollower) -> tuple[float, float]:
    """Speeds (rpm) of Figure 1.3; the first is that of Figure 1.2 as well."""
    complete = beside_interruption(system, _COMPLETE)
    return complete, beside_interruption(system, _INTERRUPTED)


def released_turn(system: CamFollower, rpm: float) -> Trajectory:
    """The motion of one turn and a tenth from the release of a sticking orbit."""
    rig = at_speed(system, rpm_to_rad_s(rpm))
    # a rig of another phase may be in contact at time zero: ask later, too
    times = float(rig.period) / _LOOKS * np.arange(_LOOKS)
    found = [_release(rig, time) for time in times]
    release = next((one for one in found if float(one.holds) == 0), found[0])
    start = float(release.time)
    return simulate(rig, release.state, start, start + 1.1 * float(rig.period))


@eqx.filter_jit
def _release(system, time):
    return release_point(system, jnp.asarray(time))


def sticking_time(run: Trajectory) -> float:
    """How long contact lasts in a run (s), apart from one at its very start."""
    contacts = run.contacts
    later = np.asarray(contacts.start) > float(run.t0)
    return float(np.sum((np.asarray(contacts.end) - np.asarray(contacts.start))[later]))


def figure_1_2(system: CamFollower) -> "pd.DataFrame":
    """Figure 1.2: impacts and rest of the orbit with complete chatter, 152.65 rpm."""
    complete = both_sides(system)[0]
    run = released_turn(system, complete)
    speeds = -np.asarray(run.impacts.speed_before)
    return frame(
        [
            ("impacts listed before the rest are summed", _NAN, len(speeds), ""),
            ("fastest impact", _NAN, np.max(speeds), "rad/s"),
            (
                "slowest of them over the fastest",
                _NAN,
                np.min(speeds) / np.max(speeds),
                "",
            ),
            ("sticking time", _NAN, sticking_time(run), "s"),
            ("period", 60 / complete, run.system.period, "s"),
        ]
    )


def figure_1_3(system: CamFollower) -> "pd.DataFrame":
    """Figure 1.3: sticking is there at 152.65 rpm and gone at 152.69 rpm."""
    rig = interruption(system)
    rows: list[tuple[str, Any, Any, str]] = [
        ("interruption", INTERRUPTION, rad_s_to_rpm(rig.speed), "rpm")
    ]
    for rpm, printed in zip(both_sides(system), (_NAN, 0.0), strict=True):
        run = released_turn(system, rpm)
        rows.append((f"sticking time at {rpm:g} rpm", printed, sticking_time(run), "s"))
    return frame(rows)
