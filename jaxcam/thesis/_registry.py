"""What can be reproduced: a name, a sentence, and the function that computes it."""

from collections.abc import Callable
from typing import NamedTuple, TYPE_CHECKING

from ..models import CamFollower
from ._chapter_1 import figure_1_2, figure_1_3
from ._chapter_2 import figure_2_3, figure_2_4, figure_2_7, figure_2_11, figure_2_13
from ._chapter_3 import figure_3_8, figure_3_11
from ._chapter_4 import (
    figure_4_5,
    figure_4_13,
    figure_4_14,
    figure_4_15,
    figure_4_16,
)
from ._table_4_4 import table_4_4
from ._table_5_2 import table_5_2
from ._table_5_3 import table_5_3
from ._table_6_1 import table_6_1
from ._table_6_2 import table_6_2
from ._table_6_3 import table_6_3
from ._table_6_4 import table_6_4


if TYPE_CHECKING:
    import pandas as pd


class Target(NamedTuple):
    """A table of the thesis, or the numbers of a figure."""

    title: str
    #: takes the rig; returns columns quantity, printed, computed, unit, difference
    compute: "Callable[[CamFollower], pd.DataFrame]"


TARGETS: dict[str, Target] = {
    "figure-1.2": Target("A periodic orbit with chatter", figure_1_2),
    "figure-1.3": Target("Chatter, complete and interrupted", figure_1_3),
    "figure-2.3": Target("Cobwebs of the logistic map", figure_2_3),
    "figure-2.4": Target("The period-doubling cascade", figure_2_4),
    "figure-2.7": Target("Normal forms of codimension one", figure_2_7),
    "figure-2.11": Target("Piecewise-smooth maps", figure_2_11),
    "figure-2.13": Target("The Zeno ball, by events and by steps", figure_2_13),
    "figure-3.8": Target("The P(1,1) orbit and its branch", figure_3_8),
    "figure-3.11": Target("The discontinuous flow of P(1,1)", figure_3_11),
    "figure-4.5": Target("A motion program with four dwells", figure_4_5),
    "figure-4.13": Target("The follower without its cam", figure_4_13),
    "figure-4.14": Target("Permanent contact at 110 rpm", figure_4_14),
    "figure-4.15": Target("Restitution by speed", figure_4_15),
    "figure-4.16": Target("Bounces at four speeds", figure_4_16),
    "table-4.4": Target("Parameters of the model", table_4_4),
    "table-5.2": Target("Multipliers along the P(1,1) branch", table_5_2),
    "table-5.3": Target("Local map at the interruption of chattering", table_5_3),
    "table-6.1": Target("End of chattering below its interruption", table_6_1),
    "table-6.2": Target("The lambda-map up to the accumulation", table_6_2),
    "table-6.3": Target("The speed of the cam in the local map", table_6_3),
    "table-6.4": Target("Closing the loop at the interruption", table_6_4),
}


def reproduce(name: str, system: CamFollower) -> "pd.DataFrame":
    """A table of the thesis or the numbers of a figure, printed beside computed.

    **Arguments:**

    - `name`: a key of [`jaxcam.thesis.TARGETS`][], such as "table-5.2".
    - `system`: the rig, such as `jaxcam.models.preset("calibrated")`.

    **Returns:** columns quantity, printed, computed, unit, difference; speeds in rpm
    and everything else in SI units. NaN where the rig has no such thing, and under
    printed where the thesis draws something but gives no number.

    **Raises:** `ValueError` for an unknown name.
    """
    if name not in TARGETS:
        known = ", ".join(TARGETS)
        raise ValueError(f"There is no {name!r} to reproduce; choose one of {known}.")
    return TARGETS[name].compute(system)
