"""`jaxcam reproduce`: tables and figures of the thesis, printed beside computed."""

from pathlib import Path
from typing import Annotated

import typer

from ._choices import choose


#: the rigs, and which of them is meant where nothing is said
_PRESETS = ("calibrated", "table-4.4")


def reproduce(
    target: Annotated[
        str | None,
        typer.Argument(
            metavar="[TARGET]",
            help="Such as table-5.2 or figure-4.5; all of them without.",
        ),
    ] = None,
    preset: Annotated[
        str,
        typer.Option(metavar="NAME", help=f"The rig: {' or '.join(_PRESETS)}."),
    ] = _PRESETS[0],
    list_: Annotated[
        bool, typer.Option("--list", help="Say what there is, and compute nothing.")
    ] = False,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Write the result; - to print it."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write CSV files and figures there."),
    ] = None,
) -> None:
    """
    Compute what the thesis prints; show both and the difference.

    \b
    Examples:
      jaxcam reproduce --list
      jaxcam reproduce table-5.2
      jaxcam reproduce figure-1.3 --out figures
      jaxcam reproduce table-5.2 --preset table-4.4 --json -
    """
    choose("--preset", preset, _PRESETS)

    from .. import models
    from ..thesis import reproduce as compute, TARGETS
    from ._cache import keep_compiled_programs
    from ._output import Output
    from ._progress import progress

    names = list(TARGETS) if target is None else [choose("TARGET", target, TARGETS)]
    output = Output(json_file, out)
    if list_:
        for name in names:
            output.print(f"{name}: {TARGETS[name].title}")
        titles = {name: TARGETS[name].title for name in names}
        output.write_json({"command": "reproduce", "targets": titles})
        return
    keep_compiled_programs()
    system = models.preset(preset)
    found = {}
    for position, name in enumerate(names):
        with progress("computing") as report:
            report(f"computing {name}", position / len(names))
            table = compute(name, system)
        output.print(_rich(f"{name}: {TARGETS[name].title} ({preset})", table))
        found[name] = table.to_dict(orient="records")
        if out is not None:
            table.to_csv(out / f"{name}.csv", index=False)
            _draw(name, system, out)
    output.write_json({"command": "reproduce", "preset": preset, "tables": found})


def _draw(name: str, system, out: Path) -> None:
    """The figure of a target, where it has one."""
    from ..plotting import save_figure, style
    from ._reproduce_figures import DRAWINGS

    if name in DRAWINGS:
        with style():
            save_figure(DRAWINGS[name](system), out / f"{name}.png")


def _rich(title: str, frame):
    """A pandas table as a table for the terminal."""
    import math

    from rich.table import Table

    table = Table(title=title)
    table.add_column("quantity", overflow="fold")
    for name in ("printed", "computed", "difference"):
        table.add_column(name, justify="right")
    table.add_column("unit")
    for row in frame.itertuples(index=False):
        lost = not math.isfinite(row.computed)
        drawn = not math.isfinite(row.printed)
        table.add_row(
            row.quantity,
            "" if drawn else f"{row.printed:.10g}",
            "none" if lost else f"{row.computed:.10g}",
            "" if lost or drawn else f"{row.difference:+.2e}",
            row.unit,
        )
    return table
