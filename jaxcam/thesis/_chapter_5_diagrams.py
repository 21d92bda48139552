"""Table 5.1 and Figures 5.1, 5.11 and 5.12: what is met over the speed."""

from typing import Any, TYPE_CHECKING

import numpy as np

from .. import sweeps
from ..models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ._chatter import beside_interruption, INTERRUPTION, interruption
from ._events import events, spans
from ._frame import frame
from ._remember import remembered


if TYPE_CHECKING:
    import pandas as pd


#: cycles at each speed and how many are kept, as section 5.2 prints them
TURNS, KEEP = 300, 100
#: rpm between speeds of Figure 5.1 and its ends
_STEP = {"default": 0.25, "full": 0.1}
_ENDS = 120.0, 170.0
#: what the text says of it: sections 5.2.1 and 5.2.2
_SAID = {
    (1, "contact", "to"): 125.0,
    (1, "P(inf,1)", "to"): 152.67,
    (-1, "P(1,1)", "from"): 135.946,
    (-1, "P(1,1)", "to"): 152.0,
    (-1, "P(4,4)", "from"): 157.5,
}
#: rpm of Figure 5.11, and how many speeds
_ZOOM = 152.6, 153.2
_ZOOMED = {"default": 401, "full": 2001}
#: Figure 5.12: rpm, starts at each, cycles and how many are kept; how many speeds
_MONTE_CARLO = 152.0, 160.0
_STARTS, _MC_TURNS, _MC_KEEP = 20, 100, 50
_DRAWN = {"default": 161, "full": 801}
#: box from which its starts are drawn
BOX = (0.34, -3.0), (0.55, 3.0)
_NAN = float("nan")


@remembered
def both_ways(system: CamFollower, size: str) -> sweeps.Diagram:
    """The diagram of Figure 5.1: upwards from contact, and back."""
    low, high = _ENDS
    speeds = np.linspace(low, high, round((high - low) / _STEP[size]) + 1)
    return sweeps.diagram(
        system,
        "speed",
        rpm_to_rad_s(speeds),
        direction="both",
        turns=TURNS,
        keep=KEEP,
    )


def figure_5_1(system: CamFollower, size: str) -> "pd.DataFrame":
    """Figure 5.1: where each orbit was met, upwards and downwards."""
    made = both_ways(system, size)
    rows: list[tuple[str, Any, Any, str]] = []
    for way, word in ((1, "upwards"), (-1, "downwards")):
        for label in ("contact", "P(inf,1)", "P(1,1)", "P(2,2)", "P(4,4)"):
            low, high = spans(made, label, way)[0]
            if np.isfinite(low):
                for end, value in (("from", low), ("to", high)):
                    printed = _SAID.get((way, label, end), _NAN)
                    rows.append((f"{word}: {label} {end}", printed, value, "rpm"))
    return frame(rows)


def table_5_1(system: CamFollower, size: str) -> "pd.DataFrame":
    """Table 5.1, the simulated column, read off the diagram of Figure 5.1.

    The two printed rows of the route to chaos and of chaos are not told apart here.
    """
    made = both_ways(system, size)
    found = events(made, made)
    return frame(
        [
            ("permanent contact, to", 125.0, found.contact_to, "rpm"),
            ("detachment", 125.0, found.sticking_from, "rpm"),
            ("P(inf,1), from", 125.0, found.sticking_from, "rpm"),
            ("P(inf,1), to", 152.0, found.sticking_to, "rpm"),
            ("chattering route to chaos, from", 152.6, found.route_from, "rpm"),
            ("chaos, to", 154.5, found.chaos_to, "rpm"),
            ("P(1,1), from", 135.0, found.one_from, "rpm"),
            ("P(1,1), to", 151.0, found.one_to, "rpm"),
            ("P(2,2), from", 152.0, found.two_from, "rpm"),
            ("P(2,2) and its doublings, to", 170.0, found.doubled_to, "rpm"),
            ("P(2,2) itself, to", _NAN, spans(made, "P(2,2)", -1)[0][1], "rpm"),
        ]
    )


@remembered
def onset(system: CamFollower, size: str) -> sweeps.Diagram:
    """The diagram of Figure 5.11, each speed from contact at rest."""
    low, high = (beside_interruption(system, rpm) for rpm in _ZOOM)
    speeds = np.linspace(low, high, _ZOOMED[size])
    return sweeps.diagram(system, "speed", rpm_to_rad_s(speeds), turns=TURNS, keep=KEEP)


def figure_5_11(system: CamFollower, size: str) -> "pd.DataFrame":
    """Figure 5.11: where P(inf,1) ends, and the windows behind it."""
    made = onset(system, size)
    speeds = np.asarray(rad_s_to_rpm(made.values))
    labels = made.labels[:, 0]
    # a run that failed says nothing of its speed
    known = labels != "failed"
    other = known & (labels != "P(inf,1)")
    first = speeds[other].min() if np.any(other) else _NAN
    behind = labels[known & (speeds >= first)]
    repeats = np.char.startswith(behind.astype(str), "P(")
    changes = int(np.count_nonzero(np.diff(repeats.astype(int))))
    exact = rad_s_to_rpm(interruption(system).speed)
    return frame(
        [
            ("first speed without P(inf,1)", 152.67, first, "rpm"),
            ("interruption", INTERRUPTION, exact, "rpm"),
            ("part of the speeds behind it that repeat", _NAN, np.mean(repeats), ""),
            ("changes between windows and chaos", _NAN, changes, ""),
            ("speeds at which the run failed", _NAN, np.count_nonzero(~known), ""),
        ]
    )


@remembered
def monte_carlo(system: CamFollower, size: str) -> sweeps.Diagram:
    """The diagram of Figure 5.12, with starts drawn anew at each speed."""
    speeds = np.linspace(*_MONTE_CARLO, _DRAWN[size])
    states = sweeps.monte_carlo(*BOX, _STARTS, 0, len(speeds))
    return sweeps.diagram(
        system,
        "speed",
        rpm_to_rad_s(speeds),
        states,
        turns=_MC_TURNS,
        keep=_MC_KEEP,
    )


def figure_5_12(system: CamFollower, size: str) -> "pd.DataFrame":
    """Figure 5.12: which orbits the random starts end on, and where."""
    made = monte_carlo(system, size)
    speeds = np.asarray(rad_s_to_rpm(made.values))
    rows: list[tuple[str, Any, Any, str]] = []
    cascades = {
        "sticking orbit": ("P(inf,1)",),
        "orbit with one impact a turn, doubled": ("P(2,2)", "P(4,4)", "P(8,8)"),
        "orbit with three turns, or doubled": ("P(3,3)", "P(6,6)", "P(12,12)"),
    }
    met = 0
    for name, labels in cascades.items():
        where = speeds[np.any(np.isin(made.labels, labels), axis=1)]
        met += bool(len(where))
        low, high = (where.min(), where.max()) if len(where) else (_NAN, _NAN)
        rows.append((f"{name}: lowest speed", _NAN, low, "rpm"))
        rows.append((f"{name}: highest speed", _NAN, high, "rpm"))
    rows.insert(0, ("coexisting cascades", 3, met, ""))
    return frame(rows)
