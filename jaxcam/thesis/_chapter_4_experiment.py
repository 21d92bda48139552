"""Figures 4.17 and 4.18: the rig's experiment of section 4.7, with a simulated rig."""

from typing import Any, TYPE_CHECKING

import numpy as np

from .. import sweeps
from ..models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ._events import Events, events
from ._frame import frame
from ._remember import remembered


if TYPE_CHECKING:
    import pandas as pd


#: s at each speed that are waited, and s that are stored (section 4.7)
DWELL = 60.0, 10.0
#: rpm at which the speed begins and ends, on the way up and on the way down
UP, DOWN = (120.0, 200.0), (200.0, 150.0)
#: rpm between speeds; not printed
_STEP = {"default": 0.5, "full": 0.1}
#: rpm that a label is met over, at least, to be listed
_WIDE = 1.0 - 1e-9
_NAN = float("nan")

#: Table 5.1: the experiment, and the simulation
RIG = Events(125, 125, 155, 155, 170, 150, 188, 188, 200)
MODEL = Events(125, 125, 152, 152.6, 154.5, 135, 151, 152, 170)


def _speeds(ends: tuple[float, float], step: float) -> np.ndarray:
    low, high = min(ends), max(ends)
    return np.asarray(
        rpm_to_rad_s(np.linspace(low, high, round((high - low) / step) + 1))
    )


@remembered
def experiment(system: CamFollower, size: str) -> tuple[sweeps.Diagram, sweeps.Diagram]:
    """Both runs: up from contact, and down from where the first has ended.

    The cam turns at each speed for a minute, and then for the ten seconds that are
    stored, once a turn; then the speed is another one and the motion goes on.
    """
    step = _STEP[size]
    forward = sweeps.diagram(
        system, "speed", _speeds(UP, step), direction="up", dwell=DWELL
    )
    end = forward.dataset["final"].values[-1]
    backward = sweeps.diagram(
        system, "speed", _speeds(DOWN, step), end, direction="down", dwell=DWELL
    )
    return forward, backward


_WORDS = Events(
    "permanent contact, to",
    "P(inf,1), from",
    "P(inf,1), to",
    "chattering route to chaos, from",
    "chaos, to",
    "P(1,1), from",
    "P(1,1), to",
    "P(2,2), from",
    "P(2,2) and its doublings, to",
)


def figure_4_17(system: CamFollower, size: str) -> "pd.DataFrame":
    """Table 5.1, both columns, beside what the experiment shows of the simulated rig.

    The way down ends at 150 rpm, so no lower speed can be found for P(1,1).
    """
    found = events(*experiment(system, size))
    rows = []
    for words, rig, model, value in zip(_WORDS, RIG, MODEL, found, strict=True):
        rows.append((f"{words}; printed of the rig", rig, value, "rpm"))
        rows.append((f"{words}; printed of the model", model, value, "rpm"))
    return frame(rows)


def figure_4_18(system: CamFollower, size: str) -> "pd.DataFrame":
    """What was stored, and every range of a label that is 1 rpm wide or wider.

    Printed are the ends that section 4.7.1 gives for the way up. On the way down the
    model, whose follower can rise without end, has orbits that no rig has room for, as
    the largest angle among the samples shows.
    """
    rows: list[tuple[str, Any, Any, str]] = []
    said = {
        ("forward", "contact", "to"): 125.0,
        ("forward", "P(inf,1)", "from"): 125.0,
        ("forward", "P(inf,1)", "to"): 155.0,
    }
    ways = ("forward", "backward")
    for way, made in zip(ways, experiment(system, size), strict=True):
        stored = np.isfinite(made.states[:, 0, :, 0]).sum(axis=1)
        turn = 2 * np.pi / made.values
        rows += [
            (f"{way}: speeds", _NAN, len(made.values), ""),
            (f"{way}: least stored at a speed", DWELL[1], np.min(stored * turn), "s"),
            (f"{way}: samples", _NAN, stored.sum(), ""),
        ]
        angles = made.states[:, 0, :, 0]
        for found in sorted(made.ranges(), key=lambda r: r.low):
            low, high = rad_s_to_rpm(found.low), rad_s_to_rpm(found.high)
            if high - low < _WIDE:
                continue
            words = f"{way}: {found.label}"
            for end, value in (("from", low), ("to", high)):
                printed = said.get((way, found.label, end), _NAN)
                rows.append((f"{words}, {end}", printed, value, "rpm"))
            some = (made.values >= found.low) & (made.values <= found.high)
            rows.append(
                (f"{words}, largest angle", _NAN, np.nanmax(angles[some]), "rad")
            )
    return frame(rows)
