"""Time series of chapters 4 and 5: what motions are at the printed speeds."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..models import CamFollower
from ._chapter_1 import released_turn, sticking_time
from ._frame import frame
from ._motions import Case, Motion, motion_rows, settled


if TYPE_CHECKING:
    import pandas as pd


_INF = np.inf
#: starts that are printed with Figures 5.14, 5.16, 5.18 and 5.20
A, B = (0.42092, 1.84), (0.33704, 0.13333)
C, D1, D2 = (0.33704, 0.24), (0.37253, 1.7867), (0.430593, 1.9466)
E, F1 = (0.36365, 0.008), (0.34623, 1.704)
G1, H1 = (0.33268, 1.656), (0.4226893, -2.552)

#: Other starts are not printed. Motions that hit once a turn are started like A, its
#: doublings like D1, and those of scenario 1 in contact at rest.
CASES: dict[str, tuple[Case, ...]] = {
    "figure-4.19": (Case(120.0, None, 0, 1),),
    "figure-4.20": (Case(150.0, None, _INF, 1),),
    "figure-4.22": (Case(165.0, None, 0, 0),),
    "figure-4.23": (Case(165.0, A, 1, 1),),
    "figure-4.24": (Case(188.0, A, 2, 2),),
    "figure-5.2": (
        Case(120.0, None, 0, 1),
        Case(148.0, None, _INF, 1),
        Case(154.1, None, 0, 0),
        Case(145.0, A, 1, 1),
        Case(152.0, D1, 2, 2),
        Case(158.0, D1, 4, 4),
    ),
    "figure-5.3": (Case(145.0, A, 1, 1),),
    "figure-5.4": (Case(152.0, D1, 2, 2),),
    "figure-5.5": (Case(158.0, D1, 4, 4),),
    "figure-5.6": (Case(120.0, None, 0, 1),),
    "figure-5.7": (Case(148.0, None, _INF, 1),),
    "figure-5.10": (Case(154.1, None, 0, 0),),
    "figure-5.15": (Case(145.0, A, 1, 1, "A"), Case(145.0, B, _INF, 1, "B")),
    "figure-5.17": (
        Case(152.3, C, _INF, 1, "C"),
        Case(152.3, D1, 2, 2, "D1"),
        Case(152.3, D2, 2, 2, "D2"),
    ),
    "figure-5.19": (Case(154.2, E, 0, 0, "E"), Case(154.2, F1, 2, 2, "F1")),
    "figure-5.21": (Case(156.0, G1, 2, 2, "G1"), Case(156.0, H1, 6, 6, "H1")),
}

#: speeds (rpm) at which one turn is shown, and whether it sticks: 1, 0 or not said
RELEASED: dict[str, tuple[tuple[float, float], ...]] = {
    "figure-4.21": ((155.0, 1), (158.0, np.nan), (160.0, 0)),
    "figure-5.8": ((151.0, 1), (153.5, 0), (153.9, 0)),
}


def motions(system: CamFollower, target: str) -> list[Motion]:
    """The motions of a figure; those of all figures are computed together, once."""
    every = tuple(dict.fromkeys(case for cases in CASES.values() for case in cases))
    found = dict(zip(every, settled(system, every), strict=True))
    return [found[case] for case in CASES[target]]


def motion_table(target: str) -> "Callable[[CamFollower], pd.DataFrame]":
    """The function that compares the motions of a figure with what is printed."""

    def table(system: CamFollower) -> "pd.DataFrame":
        return frame(motion_rows(motions(system, target)))

    table.__doc__ = f"{target}: labels of its motions, beside the printed ones."
    return table


def released_table(target: str) -> "Callable[[CamFollower], pd.DataFrame]":
    """The function that says whether the turn after a release ends in contact."""

    def table(system: CamFollower) -> "pd.DataFrame":
        rows = []
        for rpm, printed in RELEASED[target]:
            run = released_turn(system, rpm)
            time = sticking_time(run)
            rests = float(time > 0)
            rows += [
                (f"{rpm:g} rpm: rests in the turn from release", printed, rests, ""),
                (
                    f"{rpm:g} rpm: sticking time",
                    0 if printed == 0 else np.nan,
                    time,
                    "s",
                ),
            ]
        return frame(rows)

    table.__doc__ = f"{target}: complete and interrupted chattering from release."
    return table
