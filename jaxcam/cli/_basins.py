"""`jaxcam basins`: which initial states lead to which attractor."""

from pathlib import Path
from typing import Annotated

import typer

from ._basins_options import Cells
from ._checks import check_resume
from ._choices import CAM
from ._grouped import grouped
from ._options import Assignments, JsonFile, Preset, Resume, Speed, System
from ._source import Source
from ._sweep import Execution, show


_FILE = "basins.zarr"


@grouped
def basins(
    system: System = CAM,
    cells: Cells = Cells(),
    speed: Speed = None,
    source: Source = Source(),
    preset: Preset = None,
    set_: Assignments = None,
    where: Execution = Execution(),
    json_file: JsonFile = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the basins and their figure to DIR."),
    ] = None,
    resume: Resume = False,
) -> None:
    """
    Find attractors and their basins on a grid of initial states.

    \b
    Examples:
      jaxcam basins cam-follower --preset calibrated --speed 145 --out DIR
      jaxcam basins --speed 152.3 --low 0.33,0 --high 0.45,2 --shape 256,256
      jaxcam basins impact-oscillator --set omega=2.6 --turns 500 --reruns 4
    """
    system = source.name(system)
    cells.check(system)
    where.check()
    check_resume(resume, out)

    from .. import sweeps
    from ._cache import keep_compiled_programs
    from ._output import Output
    from ._parameters import make_model, parameters
    from ._progress import COMPILING, progress

    keep_compiled_programs()
    low, high = cells.corners(system)
    grid = sweeps.Grid(low, high, cells.counts)
    model = make_model(system, preset, speed, source, set_)
    where.check_system(model)
    output = Output(json_file, out)
    with where.running() as running, progress(COMPILING) as report:
        made = sweeps.basins(
            model,
            grid,
            cells.turns,
            keep=cells.keep,
            reruns=cells.reruns,
            out=None if out is None else out / _FILE,
            resume=resume,
            progress=show(report),
            **running,
        )
        figures = []
        drawable = len(grid.shape) == 2 and min(grid.shape) > 1
        if out is not None and drawable:
            report("drawing", None)
            figures = [_draw(made, out)]
    shares = made.shares
    output.print(_table(shares))
    listed = ", ".join(f"{name} {share.share:.2%}" for name, share in shares.items())
    sentence = (
        f"{system}: fractions of the {_count(made)} admissible initial states, by "
        f"attractor: {listed}."
    )
    output.print(sentence)
    output.print_figures(figures)
    output.write_json(
        {
            "command": "basins",
            "system": system,
            "parameters": parameters(model),
            "grid": {"low": grid.low, "high": grid.high, "shape": grid.shape},
            "turns": cells.turns,
            "keep": cells.keep,
            "reruns": cells.reruns,
            "attractors": _attractors(made, shares),
            "attractor": made.attractor,
            "entropy": _entropy(made, grid.shape),
            "data": None if out is None else out / _FILE,
            "sentence": sentence,
            "figures": figures,
        }
    )


def _count(made) -> int:
    return int((made.attractor != -3).sum())


def _entropy(made, shape) -> dict | None:
    """Return the basin entropies over the components that vary, or None if the grid is
    too coarse.
    """
    from ..sweeps import basin_entropy

    if min(k for k in shape if k > 1 or max(shape) == 1) < 5:
        return None
    flat = made.attractor.squeeze() if made.attractor.size > 1 else made.attractor
    return basin_entropy(flat)._asdict()


def _attractors(made, shares) -> list[dict]:
    orbits = dict(zip(made.names, made.orbits, strict=True))
    return [
        {
            "name": name,
            "share": share.share,
            "stderr": share.stderr,
            "orbit": _points(orbits.get(name)),
        }
        for name, share in shares.items()
    ]


def _points(orbit):
    """Return the points of an orbit without its padding."""
    import numpy as np

    if orbit is None:
        return None
    return orbit[np.all(np.isfinite(orbit), axis=1)]


def _table(shares):
    from rich.table import Table

    table = Table(title="Attractors")
    for column in ("attractor", "fraction of initial states", "standard error"):
        table.add_column(column)
    for name, share in shares.items():
        table.add_row(name, f"{share.share:.4%}", f"{share.stderr:.4%}")
    return table


def _draw(made, folder: Path) -> Path:
    from ..plotting import basin_picture, save_figure

    return save_figure(basin_picture(made), folder / "basins.png")
