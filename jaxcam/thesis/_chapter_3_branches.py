"""Figures 3.9 and 3.12: branches followed through interruption and fold."""

from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np

from ..models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ._chapter_5_chatter import sticking_times
from ._chapter_5_motions import A
from ._chatter import INTERRUPTION, interruption
from ._frame import frame
from ._orbits import at_speed, speed_of
from ._printed import FLIP_SPEED, FOLD_SPEED
from ._remember import remembered


if TYPE_CHECKING:
    import pandas as pd

    from continuation import Branch


#: where branches start (rpm), and how far they are followed
_START = 145.0
_LOWEST, _HITTING = 115.0, (130.0, 154.0)
#: rpm past the interruption at which the branch that sticks is left
_PAST = 0.01


def _bounds(ends: tuple[float, float]) -> tuple[float, float]:
    low, high = (float(rpm_to_rad_s(end)) for end in ends)
    return low, high


@remembered
def sticking_branch(system: CamFollower) -> "Branch":
    """P(inf,1) from the beginning of impacts to the interruption of chattering."""
    import continuation

    rig = at_speed(system, _START)
    end = float(rad_s_to_rpm(interruption(system).speed)) + _PAST
    start = continuation.periodic_orbits(rig, continuation.periodic_orbit(rig))
    return continuation.branch(
        start.problem, start, speed_of, _bounds((_LOWEST, end)), direction="both"
    )


@remembered
def hitting_branch(system: CamFollower) -> "Branch":
    """P(1,1), around its fold and past its flip."""
    import continuation

    start = continuation.periodic_orbits(at_speed(system, _START), jnp.array(A), 1)
    return continuation.branch(
        start.problem, start, speed_of, _bounds(_HITTING), direction="both"
    )


def _special(branch: "Branch", kind: str) -> float:
    """Speed (rpm) of the first special point of a kind."""
    found = [point.parameter for point in branch.special if point.kind == kind]
    return float(rad_s_to_rpm(found[0])) if found else np.nan


def sticking_along(branch: "Branch") -> list[tuple[float, float]]:
    """Speed (rpm) and sticking time (s) of the orbits that stick."""
    return [
        (float(rad_s_to_rpm(p.parameter)), float(p.observed["sticking time"]))
        for p in branch.points
        if "sticking time" in p.observed
    ]


def figure_3_9(system: CamFollower) -> "pd.DataFrame":
    """Figure 3.9: where P(inf,1) begins and where its sticking time is zero."""
    branch = sticking_branch(system)
    times = sticking_times(system)[1]
    return frame(
        [
            (
                "beginning of impacts",
                125.0,
                _special(branch, "beginning of impacts"),
                "rpm",
            ),
            (
                "interruption of chattering",
                INTERRUPTION,
                _special(branch, "interruption of chattering"),
                "rpm",
            ),
            ("sticking time 1e-5 rpm below it", 0.0, times[-1], "s"),
            ("orbits on the branch", np.nan, len(branch.regular), ""),
        ]
    )


def figure_3_12(system: CamFollower) -> "pd.DataFrame":
    """Figure 3.12: the branch of P(1,1) goes on around its turning point."""
    branch = hitting_branch(system)
    fold = _special(branch, "fold")
    unstable = [p for p in branch.regular if p.stable is not None and not p.stable]
    beyond = [p.parameter for p in unstable if np.max(np.real(p.multipliers)) > 1]
    highest = float(rad_s_to_rpm(max(beyond))) if beyond else np.nan
    return frame(
        [
            ("fold", FOLD_SPEED, fold, "rpm"),
            ("first flip", FLIP_SPEED, _special(branch, "flip"), "rpm"),
            ("saddles followed behind the fold, to", np.nan, highest, "rpm"),
            ("orbits on the branch", np.nan, len(branch.regular), ""),
        ]
    )
