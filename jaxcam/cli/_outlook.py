"""Conclusions from a diagnosis, for the terminal, the page and verdict.json."""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from rich.table import Table

from ..discrepancy import Experiment, Prediction
from ..discrepancy.terms import Value


class Rows(NamedTuple):
    """A table, with a note that explains its columns."""

    title: str
    headings: tuple[str, ...]
    rows: list[tuple[str, ...]]
    note: str


@dataclasses.dataclass(frozen=True)
class Outlook:
    """Predicted bifurcation speeds, and proposed experiments, the best first."""

    speeds: tuple[Prediction, ...] = ()
    experiments: tuple[Experiment, ...] = ()
    reason: str = ""
    """A sentence on why no speeds are predicted; empty if they are or if none were
    requested.
    """

    def tables(self) -> Iterator[Rows]:
        """Return the tables that are not empty; speeds are in rpm."""
        if self.speeds:
            yield Rows(
                "Cam speeds at which the motion changes",
                (
                    "transition",
                    "textbook model (rpm)",
                    "with the missing effects (rpm)",
                ),
                [(one.name, _rpm(one.before), _rpm(one.after)) for one in self.speeds],
                "Predictions for this rig; the standard errors follow from those of "
                "the fit.",
            )
        if self.experiments:
            yield Rows(
                "Recommended next recording",
                ("recording at", "ratio of standard errors", "parameters"),
                [(one.name, f"{one.factor:.0%}", _asked(one)) for one in self.shown],
                "The ratio is the standard error with this additional recording "
                "divided by that without it, computed from the sensitivities of the "
                "diagnosed model.",
            )

    @property
    def shown(self) -> tuple[Experiment, ...]:
        return self.experiments[:_SHOWN]

    def data(self) -> dict[str, Any]:
        """Return the data for verdict.json without empty parts; speeds are in rad/s."""
        found: dict[str, Any] = {}
        if self.speeds:
            found["predictions"] = [dataclasses.asdict(one) for one in self.speeds]
        if self.experiments:
            found["next_experiments"] = [
                {**dataclasses.asdict(one), "factor": one.factor}
                for one in self.experiments
            ]
        return found


# Maximum number of experiments in a table
_SHOWN = 5


def terminal_table(rows: Rows) -> Table:
    """Return one table for the terminal."""
    table = Table(*rows.headings, title=rows.title)
    for row in rows.rows:
        table.add_row(*row)
    return table


def _asked(one: Experiment) -> str:
    names = list(one.now)
    return ", ".join(names) if len(names) < 4 else f"mean of {len(names)} parameters"


def _rpm(speed: Value) -> str:
    if not math.isfinite(speed.value):
        return "not found"
    value, error = (30 / math.pi * x for x in (speed.value, speed.stderr))
    if not math.isfinite(error):
        return f"{value:.2f}"
    return f"{value:.2f} +- {error:.2g}"
