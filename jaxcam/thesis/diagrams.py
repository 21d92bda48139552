"""Find the main events of Table 5.1 in bifurcation diagrams against speed."""

from typing import Any, NamedTuple

import numpy as np

from .. import plotting
from ..models import rad_s_to_rpm
from ..sweeps import Diagram


CASCADE = tuple(f"P({2**k},{2**k})" for k in range(1, 5))
"""Period doublings of the orbit with one impact per cycle."""


class Events(NamedTuple):
    """Speeds (rpm) of the events, in the order of the table."""

    contact_to: Any
    sticking_from: Any
    sticking_to: Any
    route_from: Any
    chaos_to: Any
    one_from: Any
    one_to: Any
    two_from: Any
    doubled_to: Any


def label_spans(made: Diagram, label: str, way: int) -> list[tuple[float, float]]:
    """Return the speed ranges (rpm) of a label in one direction (0: any), widest
    first.
    """
    found = [
        (float(rad_s_to_rpm(r.low)), float(rad_s_to_rpm(r.high)))
        for r in made.ranges()
        if r.label == label and way in (0, r.direction)
    ]
    return sorted(found, key=lambda span: span[0] - span[1]) or [(np.nan, np.nan)]


def events(up: Diagram, down: Diagram) -> Events:
    """Return the events of the upward and downward sweeps.

    Contact, the orbits that follow from it, and the beginning of aperiodic motion are
    taken from the upward sweep; orbits with one impact per cycle are taken from the
    downward sweep. P(1,1) is only sought at speeds below those of its doubled orbit
    P(2,2). The chatter route to chaos begins after the last speed with P(inf,1). It
    ends, with the resulting chaos, at the first upward speed on the period-doubling
    cascade or, failing that, at the last speed.
    """
    contact = label_spans(up, "contact", 1)[0]
    sticking = label_spans(up, "P(inf,1)", 1)[0]
    two = label_spans(down, "P(2,2)", -1)[0]
    ones = label_spans(down, "P(1,1)", -1)
    one = next((span for span in ones if not span[1] > two[0]), (np.nan, np.nan))
    speeds, labels = _way(up, 1)
    behind = speeds > sticking[1]
    settled = speeds[behind & np.isin(labels, CASCADE)]
    route = speeds[behind & (speeds < np.min(settled, initial=np.inf))]
    first, last = (route.min(), route.max()) if len(route) else (np.nan, np.nan)
    speeds, labels = _way(down, -1)
    doubled = speeds[np.isin(labels, CASCADE)]
    return Events(
        contact[1],
        sticking[0],
        sticking[1],
        first,
        last,
        *one,
        two[0],
        doubled.max() if len(doubled) else np.nan,
    )


def _way(made: Diagram, way: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the speeds (rpm) and labels of one direction."""
    some = made.direction == way
    return np.asarray(rad_s_to_rpm(made.values))[some], made.labels[some, 0]


_LABELS = ("angle", "rad"), ("velocity", "rad/s")


def draw_diagram(made: Diagram, ax, component: int = 0) -> None:
    """Draw the angle (component 0) or velocity (component 1) against the speed in
    rpm.
    """
    plotting.sweep_diagram(
        made,
        ax,
        component=component,
        x_label=("speed", "rpm"),
        y_label=_LABELS[component],
        x_scale=30 / np.pi,
    )
