"""The shape that all reproduced tables have."""

from collections.abc import Iterable
from typing import Any, TYPE_CHECKING


if TYPE_CHECKING:
    import pandas as pd


def frame(rows: Iterable[tuple[str, Any, Any, str]]) -> "pd.DataFrame":
    """A table from rows of quantity, printed value, computed value and unit."""
    import pandas as pd

    table = pd.DataFrame(
        [
            (name, float(printed), float(found), unit)
            for name, printed, found, unit in rows
        ],
        columns=["quantity", "printed", "computed", "unit"],
    )
    table["difference"] = table["computed"] - table["printed"]
    return table
