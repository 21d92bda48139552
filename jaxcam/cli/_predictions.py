"""Predicted speeds, as a table for the terminal, for a page, and as data."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from rich.table import Table

from ..discrepancy import Prediction, Value


#: columns of the table; speeds in rpm
HEADINGS = ("what happens", "textbook (rpm)", "with what was found (rpm)")


def prediction_rows(foretold: Sequence[Prediction]) -> list[tuple[str, str, str]]:
    """Rows under `HEADINGS`."""
    return [(one.name, _rpm(one.before), _rpm(one.after)) for one in foretold]


def prediction_table(foretold: Sequence[Prediction]) -> Table:
    """The same for the terminal."""
    table = Table(*HEADINGS)
    for row in prediction_rows(foretold):
        table.add_row(*row)
    return table


def as_data(foretold: Sequence[Prediction]) -> dict[str, Any]:
    """For verdict.json: speeds in rad/s; empty where nothing was predicted."""
    if not foretold:
        return {}
    return {"predictions": [dataclasses.asdict(one) for one in foretold]}


def _rpm(speed: Value) -> str:
    if not math.isfinite(speed.value):
        return "not found"
    value, error = (30 / math.pi * x for x in (speed.value, speed.stderr))
    if not math.isfinite(error):
        return f"{value:.2f}"
    return f"{value:.2f} +- {error:.2g}"
