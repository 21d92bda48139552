"""What can be reproduced: a name, a sentence, and the function that computes it."""

from collections.abc import Callable
from typing import NamedTuple, TYPE_CHECKING

from ..models import CamFollower
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
    """A table of the thesis."""

    title: str
    #: takes the rig; returns columns quantity, printed, computed, unit, difference
    compute: "Callable[[CamFollower], pd.DataFrame]"


TARGETS: dict[str, Target] = {
    "table-4.4": Target("Parameters of the model", table_4_4),
    "table-5.2": Target("Multipliers along the P(1,1) branch", table_5_2),
    "table-5.3": Target("Local map at the interruption of chattering", table_5_3),
    "table-6.1": Target("End of chattering below its interruption", table_6_1),
    "table-6.2": Target("The lambda-map up to the accumulation", table_6_2),
    "table-6.3": Target("The speed of the cam in the local map", table_6_3),
    "table-6.4": Target("Closing the loop at the interruption", table_6_4),
}


def reproduce(name: str, system: CamFollower) -> "pd.DataFrame":
    """A table of the thesis, printed beside computed.

    **Arguments:**

    - `name`: a key of [`jaxcam.thesis.TARGETS`][], such as "table-5.2".
    - `system`: the rig, such as `jaxcam.models.preset("calibrated")`.

    **Returns:** columns quantity, printed, computed, unit, difference; speeds in rpm
    and everything else in SI units. NaN where the rig has no such thing.

    **Raises:** `ValueError` for an unknown name.
    """
    if name not in TARGETS:
        known = ", ".join(TARGETS)
        raise ValueError(f"There is no {name!r} to reproduce; choose one of {known}.")
    return TARGETS[name].compute(system)
