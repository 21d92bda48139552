"""Conclusions from a diagnosis: for the terminal, for its page, and as data."""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from rich.table import Table

from ..discrepancy import Experiment, Prediction
from ..discrepancy.terms import Value


class Rows(NamedTuple):
    """One table, and what its columns mean."""

    title: str
    headings: tuple[str, ...]
    rows: list[tuple[str, ...]]
    note: str


@dataclasses.dataclass(frozen=True)
class Outlook:
    """Speeds at which the motion changes, and what to record next, the best first."""

    speeds: tuple[Prediction, ...] = ()
    experiments: tuple[Experiment, ...] = ()

    def tables(self) -> Iterator[Rows]:
        """Those that there is something in; speeds in rpm."""
        if self.speeds:
            yield Rows(
                "What changes",
                ("what happens", "textbook (rpm)", "with what was found (rpm)"),
                [(one.name, _rpm(one.before), _rpm(one.after)) for one in self.speeds],
                "Speeds of the cam at which the motion of this rig changes, with the "
                "standard errors that those of the fit make.",
            )
        if self.experiments:
            yield Rows(
                "What to record next",
                ("one more record at", "errors become", "of"),
                [(one.name, f"{one.factor:.0%}", _asked(one)) for one in self.shown],
                "Standard errors with such a record beside those there are, from the "
                "sensitivities of the model that was found.",
            )

    @property
    def shown(self) -> tuple[Experiment, ...]:
        return self.experiments[:_SHOWN]

    def data(self) -> dict[str, Any]:
        """For verdict.json: speeds in rad/s; without what there is nothing of."""
        found: dict[str, Any] = {}
        if self.speeds:
            found["predictions"] = [dataclasses.asdict(one) for one in self.speeds]
        if self.experiments:
            found["next_experiments"] = [
                {**dataclasses.asdict(one), "factor": one.factor}
                for one in self.experiments
            ]
        return found


# Experiments in a table
_SHOWN = 5


def terminal_table(rows: Rows) -> Table:
    """One table for the terminal."""
    table = Table(*rows.headings, title=rows.title)
    for row in rows.rows:
        table.add_row(*row)
    return table


def _asked(one: Experiment) -> str:
    names = list(one.now)
    return ", ".join(names) if len(names) < 4 else f"{len(names)} terms on average"


def _rpm(speed: Value) -> str:
    if not math.isfinite(speed.value):
        return "not found"
    value, error = (30 / math.pi * x for x in (speed.value, speed.stderr))
    if not math.isfinite(error):
        return f"{value:.2f}"
    return f"{value:.2f} +- {error:.2g}"
