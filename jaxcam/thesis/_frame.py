"""The shape that all reproduced tables have."""

from collections.abc import Iterable
from typing import Any, TYPE_CHECKING

import numpy as np


if TYPE_CHECKING:
    import pandas as pd


def frame(rows: Iterable[tuple[str, Any, Any, str]]) -> "pd.DataFrame":
    """A table from rows of quantity, printed value, computed value and unit.

    The relative difference is that over the size of the printed value; NaN where that
    is zero and the computed one is not.
    """
    import pandas as pd

    table = pd.DataFrame(
        [
            (name, float(printed), float(found), unit)
            for name, printed, found, unit in rows
        ],
        columns=["quantity", "printed", "computed", "unit"],
    )
    difference = table["computed"] - table["printed"]
    size = table["printed"].abs().where(table["printed"] != 0, np.nan)
    table["difference"] = difference
    table["relative"] = (difference / size).where(difference != 0, 0.0)
    return table
