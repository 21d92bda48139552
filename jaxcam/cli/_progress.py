"""A progress bar on standard error."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
)


COMPILING = "compiling (the first run of a system takes longest)"
"""First message of commands that compile before they compute."""


@contextmanager
def progress(first: str) -> Iterator[Callable[[str, float | None], None]]:
    """Yield `report(sentence, fraction)`; the fraction is None if unknown.

    Nothing is shown unless standard error is a terminal.
    """
    console = Console(stderr=True)
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
    )
    shown = console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=not shown) as bar:
        task = bar.add_task(first, total=None)

        def report(what: str, fraction: float | None) -> None:
            total = None if fraction is None else 1.0
            bar.update(task, description=what, total=total, completed=fraction or 0.0)

        yield report
