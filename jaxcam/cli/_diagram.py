"""`jaxcam diagram`: a bifurcation diagram by brute force."""

import math
from pathlib import Path
from typing import Annotated

import typer

from ._choices import CAM, choose, make_system, saved_name, SYSTEMS
from ._options import (
    Cluster,
    Highest,
    JsonFile,
    Lowest,
    Preset,
    Resume,
    SavedSystem,
    Settings,
    System,
    Workers,
)


DIRECTIONS = ("each", "up", "down", "both")
SECTIONS = ("stroboscope", "impacts")
_FILE = "diagram.zarr"


def diagram(
    system: System = CAM,
    parameter: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="The parameter that varies, such as speed or omega."
        ),
    ] = "speed",
    low: Lowest = None,
    high: Highest = None,
    points: Annotated[int, typer.Option(metavar="N", help="How many values.")] = 200,
    turns: Annotated[
        int, typer.Option(metavar="N", help="Forcing periods at each value.")
    ] = 300,
    keep: Annotated[
        int, typer.Option(metavar="N", help="Of these, the last N are drawn.")
    ] = 100,
    direction: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="up, down or both ways with the state carried on, or each value from "
            "the same start.",
        ),
    ] = "both",
    dwell: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help="Seconds to wait and to store at each value, as a rig is driven, in "
            "place of --turns and --keep.",
        ),
    ] = None,
    section: Annotated[
        str, typer.Option(metavar="NAME", help=f"One of {', '.join(SECTIONS)}.")
    ] = "stroboscope",
    state: Annotated[
        str | None,
        typer.Option(metavar="A,B", help="Start; without, in contact at rest."),
    ] = None,
    starts: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="Or N random starts of each value, between --low, --high."
        ),
    ] = None,
    corner: Annotated[
        str | None,
        typer.Option("--low", metavar="A,B", help="Lowest state of random starts."),
    ] = None,
    opposite: Annotated[
        str | None,
        typer.Option("--high", metavar="A,B", help="Highest state of random starts."),
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", help="Of random starts.")] = 0,
    saved: SavedSystem = None,
    preset: Preset = None,
    set_: Settings = None,
    workers: Workers = None,
    cluster: Cluster = None,
    json_file: JsonFile = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the samples and the figure there."),
    ] = None,
    resume: Resume = False,
) -> None:
    """
    Draw where motions settle over a parameter; list what they are.

    \b
    Examples:
      jaxcam diagram --preset calibrated --from 130 --to 160 --out DIR
      jaxcam diagram --from 152 --to 160 --starts 20 --low 0.34,-2 --high 0.5,3
      jaxcam diagram impact-oscillator --parameter omega --from 2.6 --to 2.9
      jaxcam diagram --from 150 --to 154 --section impacts --direction each
      jaxcam diagram --from 120 --to 200 --direction up --dwell 60,10
    """
    if saved is not None:
        system = saved_name(saved)
    choose("SYSTEM", system, SYSTEMS)
    choose("--direction", direction, DIRECTIONS)
    choose("--section", section, SECTIONS)

    from ._continue import _bounds
    from ._sweep import at_least, check_cluster, check_size, numbers, running, show

    low, high = _bounds(low, high)
    for option, value in (
        ("--points", points),
        ("--keep", keep),
        ("--starts", starts),
        ("--workers", workers),
    ):
        at_least(option, value, 1)
    at_least("--turns", turns, keep)
    at_least("--seed", seed, 0)
    check_size("--points, --starts and --keep", points, starts or 1, keep)
    check_cluster(cluster)
    if resume and out is None:
        raise ValueError("--resume needs the folder of the interrupted run: --out DIR.")
    if starts is not None and (corner is None or opposite is None):
        raise ValueError(
            "--starts needs the box to draw them from: --low A,B --high A,B."
        )
    if starts is not None and state is not None:
        raise ValueError("Give --state or --starts, not both.")
    seconds = None if dwell is None else numbers("--dwell", dwell, "60,10")
    if seconds is not None and len(seconds) != 2:
        raise ValueError(
            f"--dwell is {dwell!r}; give the seconds to wait and to store, such as "
            "60,10."
        )
    given = None if state is None else numbers("--state", state, "0.4,1.8")
    box = None
    if starts is not None:
        box = (
            numbers("--low", str(corner), "0.34,-2"),
            numbers("--high", str(opposite), "0.5,3"),
        )

    import numpy as np

    from .. import sweeps
    from ._cache import keep_compiled_programs
    from ._output import Output
    from ._parameters import parameters, set_parameters
    from ._progress import progress

    keep_compiled_programs()
    model = set_parameters(make_system(system, preset, None, saved), set_ or ())
    # speeds are rpm at the command line and rad/s inside
    unit = math.pi / 30 if parameter == "speed" and system == CAM else 1.0
    values = unit * np.linspace(low, high, points)
    states = given
    if box is not None:
        each = points if direction == "each" else None
        states = sweeps.monte_carlo(*box, starts or 1, seed, each)
    looked = sweeps.ImpactSection(model) if section == "impacts" else model
    output = Output(json_file, out)
    with (
        running(cluster, workers) as where,
        progress("compiling (the first run of a system takes longest)") as report,
    ):
        made = sweeps.diagram(
            looked,
            parameter,
            values,
            states,
            turns=turns,
            keep=keep,
            direction=direction,  # pyright: ignore
            dwell=seconds,  # pyright: ignore
            out=None if out is None else out / _FILE,
            resume=resume,
            progress=show(report),
            **where,
        )
        figures = []
        if out is not None:
            report("drawing", None)
            figures = [_draw(made, parameter, unit, section, out)]
    ranges = made.ranges()
    name = "speed in rpm" if unit != 1.0 else parameter
    output.print(_table(ranges, name, unit))
    # with --dwell fewer turns fit into the seconds of slow values
    total = int(np.prod(made.states.shape[:3]))
    if seconds is not None:
        total = int(np.isfinite(made.states[..., 0]).sum())
    failed = int(np.count_nonzero(made.dataset["code"].values))
    sentence = (
        f"{system}: {total} samples, {name} from {low:g} to {high:g}; "
        f"{len(ranges)} ranges of labels"
        + (f", {failed} motions failed or could not start." if failed else ".")
    )
    output.print(sentence)
    if figures:
        output.print(f"Figures: {', '.join(map(str, figures))}")
    output.write_json(
        {
            "command": "diagram",
            "system": system,
            "parameters": parameters(model),
            "parameter": parameter,
            "turns": turns,
            "keep": keep,
            "dwell": seconds,
            "direction": made.direction,
            "values": made.values,
            "labels": made.labels,
            "ranges": [r._asdict() for r in ranges],
            "data": None if out is None else out / _FILE,
            "sentence": sentence,
            "figures": figures,
        }
    )


def _table(ranges, name: str, unit: float):
    """The labels in the order in which they were met, not more than a screenful."""
    from rich.table import Table

    table = Table(title=f"what motions settle on, by {name}")
    for column in ("way", "from", "to", "label"):
        table.add_column(column)
    words = {0: "each", 1: "up", -1: "down"}
    for r in ranges[:40]:
        ends = (r.low, r.high) if r.direction >= 0 else (r.high, r.low)
        cells = (f"{end / unit:.6g}" for end in ends)
        table.add_row(words[r.direction], *cells, r.label)
    if len(ranges) > 40:
        table.add_row("...", "", "", f"{len(ranges) - 40} more")
    return table


def _draw(made, parameter: str, unit: float, section: str, folder: Path) -> Path:
    from ..plotting import save_figure, sweep_diagram

    figure = sweep_diagram(
        made,
        phase=section == "impacts",
        x_label=("speed", "rpm") if unit != 1.0 else (parameter, "-"),
        x_scale=1 / unit,
    )
    return save_figure(figure, folder / "diagram.png")
