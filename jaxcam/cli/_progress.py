"""A progress bar on standard error, or lines of text if that is not a terminal."""

import time
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


# minimum time (s) between lines
_INTERVAL = 30.0


@contextmanager
def progress(first: str) -> Iterator[Callable[[str, float | None], None]]:
    """Yield `report(sentence, fraction)`; the fraction is None if unknown.

    If standard error is not a terminal, the latest sentence is written as a line, at
    most twice a minute.
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
        task, written = bar.add_task(first, total=None), time.monotonic()

        def report(what: str, fraction: float | None) -> None:
            nonlocal written
            if not shown and time.monotonic() - written >= _INTERVAL:
                written = time.monotonic()
                done = "" if fraction is None else f" ({fraction:.0%})"
                console.print(
                    f"{what}{done}", markup=False, highlight=False, soft_wrap=True
                )
            total = None if fraction is None else 1.0
            bar.update(task, description=what, total=total, completed=fraction or 0.0)

        yield report
