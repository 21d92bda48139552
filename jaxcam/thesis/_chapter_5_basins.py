"""Figures 5.14, 5.16, 5.18, 5.20, 5.22 and 5.23: basins of attraction."""

from collections.abc import Callable
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from .. import sweeps
from ..models import CamFollower
from ._chapter_5_motions import A, B, C, D1, D2, E, F1, G1, H1
from ._frame import frame
from ._orbits import at_speed
from ._remember import remembered


if TYPE_CHECKING:
    import pandas as pd


#: what is printed with Figure 5.23, and a box of ours for the other figures
_ZOOM = (0.3, -4.0), (0.8, 3.2)
_BOX = (0.33, -3.5), (0.6, 3.5)
_SHAPE = {"default": 128, "full": 400}
_TURNS, _KEEP, _RERUNS = 100, 48, 2
_NAN = float("nan")


class Picture(NamedTuple):
    """A figure of basins: the speed, its labels and its printed points."""

    rpm: float
    #: labels of its attractors, as printed; chaos is "aperiodic"
    labels: tuple[str, ...]
    points: dict[str, tuple[float, float]]
    #: corners of the states
    low: tuple[float, float] = _BOX[0]
    high: tuple[float, float] = _BOX[1]
    #: how often motions that do not repeat yet go on, for twice as many turns
    reruns: int = _RERUNS


PICTURES = {
    "figure-5.14": Picture(145.0, ("P(inf,1)", "P(1,1)"), {"A": A, "B": B}),
    "figure-5.16": Picture(152.3, ("P(inf,1)", "P(2,2)"), {"C": C, "D1": D1, "D2": D2}),
    "figure-5.18": Picture(154.2, ("aperiodic", "P(2,2)"), {"E": E, "F1": F1}),
    # P(6,6) is reached so slowly that two reruns leave most of it without a label
    "figure-5.20": Picture(156.0, ("P(2,2)", "P(6,6)"), {"G1": G1, "H1": H1}, reruns=4),
    "figure-5.22": Picture(160.5, ("aperiodic",), {}, (0.3, -10.0), (1.2, 10.0)),
    "figure-5.23": Picture(160.5, ("aperiodic",), {}, *_ZOOM),
}


@remembered
def basins_of(system: CamFollower, target: str, size: str) -> sweeps.Basins:
    """The basins of a figure."""
    picture = PICTURES[target]
    count = _SHAPE[size]
    return sweeps.basins(
        at_speed(system, picture.rpm),
        sweeps.Grid(picture.low, picture.high, (count, count)),
        _TURNS,
        keep=_KEEP,
        reruns=picture.reruns,
    )


def basins_table(target: str) -> "Callable[[CamFollower, str], pd.DataFrame]":
    """The function that compares the attractors of a figure with the printed ones."""

    def table(system: CamFollower, size: str) -> "pd.DataFrame":
        found = basins_of(system, target, size)
        picture = PICTURES[target]
        shares = found.shares
        rows: list[tuple[str, Any, Any, str]] = []
        for label in picture.labels:
            own = [name for name in found.names if name.split(" ")[0] == label]
            rows.append((f"attractors {label}", 1, len(own), ""))
        for name, share in shares.items():
            rows.append((f"part of the states: {name}", _NAN, share.share, ""))
        return frame(rows)

    table.__doc__ = f"{target}: attractors met, and the parts of states they draw."
    return table


def places(target: str) -> np.ndarray:
    """The printed points of a figure, shape `(points, 2)`."""
    return np.array(list(PICTURES[target].points.values())).reshape(-1, 2)
