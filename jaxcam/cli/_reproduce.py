"""`jaxcam reproduce`: compare values printed in the thesis with computed ones."""

import time
from pathlib import Path
from typing import Annotated

import typer

from ._choices import choose
from ._options import JsonFile, Resume


_PRESETS = ("calibrated", "table-4.4")
"""Presets of the rig; the first is the default."""
_SIZES = ("default", "full")
_ALL = "all"


def reproduce(
    target: Annotated[
        str | None,
        typer.Argument(
            metavar="[TARGET]",
            help="A table or figure, such as table-5.2 or figure-4.5; default: all.",
        ),
    ] = None,
    preset: Annotated[
        str, typer.Option(metavar="NAME", help=f"Rig: {' or '.join(_PRESETS)}.")
    ] = _PRESETS[0],
    size: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help=(
                "Resolution of diagrams and basins: default, which is coarse, or full, "
                "as in the thesis."
            ),
        ),
    ] = _SIZES[0],
    list_: Annotated[
        bool, typer.Option("--list", help="List the targets without computing them.")
    ] = False,
    json_file: JsonFile = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write numbers and figures to DIR; if TARGET is all, also write a web "
            "page.",
        ),
    ] = None,
    resume: Resume = False,
) -> None:
    """
    Reproduce tables and figures from a PhD thesis (Alzate, 2008).

    The tables compare the values printed in the thesis with computed values.

    \b
    Examples:
      jaxcam reproduce --list
      jaxcam reproduce table-5.2
      jaxcam reproduce figure-1.3 --out figures
      jaxcam reproduce all --out thesis
      jaxcam reproduce all --out thesis --resume
      jaxcam reproduce table-5.2 --preset table-4.4 --json -
    """
    choose("--preset", preset, _PRESETS)
    choose("--size", size, _SIZES)
    if resume and out is None:
        raise ValueError(
            "--resume needs the folder of the interrupted command: --out DIR."
        )

    from ..thesis import TARGETS
    from ._output import Output

    target = None if target == _ALL else target
    names = list(TARGETS) if target is None else [choose("TARGET", target, TARGETS)]
    output = Output(json_file, out)
    if list_:
        for name in names:
            output.print(f"{name}: {TARGETS[name].title}")
        titles = {name: TARGETS[name].title for name in names}
        output.write_json({"command": "reproduce", "targets": titles})
        return
    _compute(names, preset, size, output, resume, several=target is None)


def _compute(names, preset, size, output, resume, several: bool) -> None:
    from .. import models
    from ..thesis import TARGETS
    from ._cache import keep_compiled_programs
    from ._errors import fail, STOPPED_EARLY
    from ._progress import progress
    from ._reproduce_page import write_page
    from ._reproduce_record import by_other_code, earlier, make, Origin, write

    keep_compiled_programs()
    system = models.preset(preset)
    settings = Origin.of(preset, size)
    out = output.folder
    if resume and out is not None:
        changed = by_other_code(out, names, settings)
        if changed:
            output.print(
                f"The code has changed since {len(changed)} of {len(names)} targets "
                "were computed; they will be recomputed."
            )
    records, begin = [], time.perf_counter()
    for position, name in enumerate(names):
        record = None
        if resume and out is not None:
            record = earlier(out, name, settings)
        if record is None:
            with progress("computing") as report:
                words = f"{name} ({position + 1} of {len(names)})"
                report(words, position / len(names) if several else None)
                # a failed target does not stop the others
                record = make(
                    name,
                    system,
                    settings,
                    out,
                    keep_going=several,
                    progress=_within(report, words, position, len(names)),
                )
            write(record, out)
        records.append(record)
        if record.error is None:
            title = f"{name}: {TARGETS[name].title} ({preset})"
            output.print(_rich(title, record.table))
        else:
            fail(f"{name} failed: {record.error}")
        if several and out is not None:
            write_page(out, records, settings, of=len(names))
    failed = [record.name for record in records if record.error is not None]
    if several:
        minutes = (time.perf_counter() - begin) / 60
        words = f", {len(failed)} failed: {', '.join(failed)}" if failed else ""
        output.print(f"{len(records)} targets in {minutes:.1f} minutes{words}.")
        if out is not None:
            output.print(f"Page: {out / 'index.html'}")
    found = {record.name: record.rows for record in records if record.error is None}
    errors = {record.name: record.error for record in records if record.name in failed}
    output.write_json(
        {
            "command": "reproduce",
            "preset": preset,
            "size": size,
            "tables": found,
            "failed": errors,
        }
    )
    if failed:
        raise typer.Exit(STOPPED_EARLY)


def _within(report, words: str, position: int, count: int):
    """Return a callback that shows the progress of a target and of all targets."""

    def callback(sentence: str, fraction: float | None) -> None:
        if fraction is None and count > 1:
            fraction = 0.0
        share = None if fraction is None else (position + fraction) / count
        report(f"{words}: {sentence}", share)

    return callback


def _rich(title: str, frame):
    """Convert a pandas table to a table for the terminal."""
    from rich.table import Table

    from ._reproduce_page import cells, HEADINGS

    table = Table(title=title)
    table.add_column(HEADINGS[0], overflow="fold")
    for name in HEADINGS[1:-1]:
        table.add_column(name, justify="right")
    table.add_column(HEADINGS[-1])
    for row in frame.itertuples(index=False):
        table.add_row(*cells(row))
    return table
