"""Figures 1.2 and 1.3: a periodic orbit with chatter, complete and interrupted."""

from typing import Any, TYPE_CHECKING

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..hybrid import release_point, simulate, Trajectory
from ..models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ._chatter import at_speed, INTERRUPTION, interruption
from ._frame import frame


if TYPE_CHECKING:
    import pandas as pd


#: speeds of Figure 1.3 (rpm), either side of the interruption
COMPLETE, INTERRUPTED = 152.65, 152.69
#: the first is drawn in Figure 1.2 as well
_NAN = float("nan")


def released_turn(system: CamFollower, rpm: float) -> Trajectory:
    """The motion of one turn and a tenth from the release of a sticking orbit."""
    rig = at_speed(system, rpm_to_rad_s(rpm))
    release = _release(rig)
    start = float(release.time)
    return simulate(rig, release.state, start, start + 1.1 * float(rig.period))


@eqx.filter_jit
def _release(system):
    return release_point(system, jnp.asarray(0.0))


def sticking_time(run: Trajectory) -> float:
    """How long contact lasts in a run (s), apart from one at its very start."""
    contacts = run.contacts
    later = np.asarray(contacts.start) > float(run.t0)
    return float(np.sum((np.asarray(contacts.end) - np.asarray(contacts.start))[later]))


def figure_1_2(system: CamFollower) -> "pd.DataFrame":
    """Figure 1.2: impacts and rest of the orbit with complete chatter, 152.65 rpm."""
    run = released_turn(system, COMPLETE)
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
            ("period", 60 / COMPLETE, run.system.period, "s"),
        ]
    )


def figure_1_3(system: CamFollower) -> "pd.DataFrame":
    """Figure 1.3: sticking is there at 152.65 rpm and gone at 152.69 rpm."""
    rig = interruption(system)
    rows: list[tuple[str, Any, Any, str]] = [
        ("interruption", INTERRUPTION, rad_s_to_rpm(rig.speed), "rpm")
    ]
    for rpm in (COMPLETE, INTERRUPTED):
        run = released_turn(system, rpm)
        printed = 0.0 if rpm == INTERRUPTED else _NAN
        rows.append((f"sticking time at {rpm} rpm", printed, sticking_time(run), "s"))
    return frame(rows)
