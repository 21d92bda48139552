"""`jaxcam basins`: which initial states end on which attractor."""

from pathlib import Path
from typing import Annotated

import typer

from ._choices import CAM, choose, make_system, saved_name, SYSTEMS
from ._options import (
    Cluster,
    JsonFile,
    Preset,
    Resume,
    SavedSystem,
    Settings,
    Speed,
    System,
    Workers,
)


_FILE = "basins.zarr"
# where something happens, for systems where nothing is said
_BOXES = {
    CAM: ((0.33, -3.0), (0.55, 3.0)),
    "impact-oscillator": ((-1.0, -2.0), (0.0, 2.0)),
}


def basins(
    system: System = CAM,
    low: Annotated[
        str | None, typer.Option(metavar="A,B", help="Lowest state of the grid.")
    ] = None,
    high: Annotated[
        str | None, typer.Option(metavar="A,B", help="Highest state of the grid.")
    ] = None,
    shape: Annotated[
        str, typer.Option(metavar="K,L", help="Cells along each component.")
    ] = "128,128",
    turns: Annotated[
        int, typer.Option(metavar="N", help="Forcing periods of each motion.")
    ] = 100,
    keep: Annotated[
        int, typer.Option(metavar="N", help="Of these, the last N are compared.")
    ] = 24,
    reruns: Annotated[
        int,
        typer.Option(
            metavar="N",
            help="How often motions that do not repeat yet go on, each time for twice "
            "as many turns.",
        ),
    ] = 1,
    speed: Speed = None,
    saved: SavedSystem = None,
    preset: Preset = None,
    set_: Settings = None,
    workers: Workers = None,
    cluster: Cluster = None,
    json_file: JsonFile = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the basins and their picture there."),
    ] = None,
    resume: Resume = False,
) -> None:
    """
    Find the attractors, and which initial states end on each.

    \b
    Examples:
      jaxcam basins cam-follower --preset calibrated --speed 145 --out DIR
      jaxcam basins --speed 152.3 --low 0.33,0 --high 0.45,2 --shape 256,256
      jaxcam basins impact-oscillator --set omega=2.6 --turns 500 --reruns 4
    """
    if saved is not None:
        system = saved_name(saved)
    choose("SYSTEM", system, SYSTEMS)

    from ._sweep import at_least, check_cluster, check_size, numbers, running, show

    box = _BOXES.get(system)
    if box is None and (low is None or high is None):
        raise ValueError(
            f"{system} needs the corners of the grid: --low A,B --high A,B."
        )
    corners = [
        numbers(option, text, "0.34,-2") if text is not None else default
        for option, text, default in zip(
            ("--low", "--high"), (low, high), box or ((), ()), strict=True
        )
    ]
    cells = numbers("--shape", shape, "128,128")
    if any(cell != int(cell) for cell in cells):
        raise ValueError(f"--shape is {shape!r}; give whole numbers.")
    at_least("--keep", keep, 2)
    at_least("--turns", turns, keep)
    at_least("--reruns", reruns, 0)
    at_least("--workers", workers, 1)
    check_size("--shape and --keep", *(max(1, int(k)) for k in cells), keep)
    check_cluster(cluster)
    if resume and out is None:
        raise ValueError("--resume needs the folder of the interrupted run: --out DIR.")

    from .. import sweeps
    from ._cache import keep_compiled_programs
    from ._output import Output
    from ._parameters import parameters, set_parameters
    from ._progress import progress

    keep_compiled_programs()
    grid = sweeps.Grid(corners[0], corners[1], tuple(map(int, cells)))
    model = set_parameters(make_system(system, preset, speed, saved), set_ or ())
    output = Output(json_file, out)
    with (
        running(cluster, workers) as where,
        progress("compiling (the first run of a system takes longest)") as report,
    ):
        made = sweeps.basins(
            model,
            grid,
            turns,
            keep=keep,
            reruns=reruns,
            out=None if out is None else out / _FILE,
            resume=resume,
            progress=show(report),
            **where,
        )
        figures = []
        drawable = len(grid.shape) == 2 and min(grid.shape) > 1
        if out is not None and drawable:
            report("drawing", None)
            figures = [_draw(made, out)]
    shares = made.shares
    output.print(_table(shares))
    entropy = None
    if min(k for k in grid.shape if k > 1 or max(grid.shape) == 1) >= 5:
        entropy = sweeps.basin_entropy(_flat(made))
    listed = ", ".join(f"{name} {share.share:.2%}" for name, share in shares.items())
    sentence = f"{system}: of {_count(made)} states that can start, {listed}."
    output.print(sentence)
    if figures:
        output.print(f"Figures: {', '.join(map(str, figures))}")
    orbits = dict(zip(made.names, made.orbits, strict=True))
    output.write_json(
        {
            "command": "basins",
            "system": system,
            "parameters": parameters(model),
            "grid": {"low": grid.low, "high": grid.high, "shape": grid.shape},
            "turns": turns,
            "keep": keep,
            "reruns": reruns,
            "attractors": [
                {
                    "name": name,
                    "share": share.share,
                    "stderr": share.stderr,
                    "orbit": _points(orbits.get(name)),
                }
                for name, share in shares.items()
            ],
            "attractor": made.attractor,
            "entropy": None if entropy is None else entropy._asdict(),
            "data": None if out is None else out / _FILE,
            "sentence": sentence,
            "figures": figures,
        }
    )


def _count(made) -> int:
    return int((made.attractor != -3).sum())


def _flat(made):
    """Attractors without the components that do not vary."""
    return made.attractor.squeeze() if made.attractor.size > 1 else made.attractor


def _points(orbit):
    """Points of an orbit, without what it is filled up with."""
    import numpy as np

    if orbit is None:
        return None
    return orbit[np.all(np.isfinite(orbit), axis=1)]


def _table(shares):
    from rich.table import Table

    table = Table(title="attractors")
    for column in ("attractor", "share of states", "standard error"):
        table.add_column(column)
    for name, share in shares.items():
        table.add_row(name, f"{share.share:.4%}", f"{share.stderr:.4%}")
    return table


def _draw(made, folder: Path) -> Path:
    from ..plotting import basin_picture, save_figure

    return save_figure(basin_picture(made), folder / "basins.png")
