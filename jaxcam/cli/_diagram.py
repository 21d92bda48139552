"""`jaxcam diagram`: a bifurcation diagram by brute force."""

from pathlib import Path
from typing import Annotated

import typer

from ._axis import Axis
from ._checks import check_resume
from ._choices import CAM
from ._diagram_options import Starts, Sweep
from ._grouped import grouped
from ._options import Assignments, JsonFile, Preset, Resume, System
from ._source import Source
from ._sweep import Execution, show


_FILE = "diagram.zarr"


@grouped
def diagram(
    system: System = CAM,
    sweep: Sweep = Sweep(),
    starts: Starts = Starts(),
    source: Source = Source(),
    preset: Preset = None,
    set_: Assignments = None,
    where: Execution = Execution(),
    json_file: JsonFile = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the samples and the figure to DIR."),
    ] = None,
    resume: Resume = False,
) -> None:
    """
    Draw a bifurcation diagram and list the parameter ranges of the attractors.

    \b
    Examples:
      jaxcam diagram --preset calibrated --from 130 --to 160 --out DIR
      jaxcam diagram --from 152 --to 160 --starts 20 --low 0.34,-2 --high 0.5,3
      jaxcam diagram impact-oscillator --parameter omega --from 2.6 --to 2.9
      jaxcam diagram --from 150 --to 154 --section impacts --direction each
      jaxcam diagram --from 120 --to 200 --direction up --dwell 60,10
    """
    system = source.name(system)
    sweep.check()
    starts.check(sweep)
    where.check()
    check_resume(resume, out)
    seconds = sweep.seconds

    import numpy as np

    from .. import sweeps
    from ._cache import keep_compiled_programs
    from ._natural_start import natural_start
    from ._output import Output
    from ._parameters import chosen_parameter, make_model, parameters
    from ._progress import COMPILING, progress

    keep_compiled_programs()
    model = make_model(system, preset, None, source, set_)
    where.check_system(model)
    picked = chosen_parameter(model, sweep.parameter)
    axis = Axis.of(sweep.parameter, system, source.units(), sweep.unit)
    states, words = starts.states(sweep), ""
    if source and states is None:
        states, words = natural_start(model, source)
    looked = sweeps.ImpactSection(model) if sweep.section == "impacts" else model
    output = Output(json_file, out)
    with where.running() as running, progress(COMPILING) as report:
        made = sweeps.diagram(
            looked,
            picked,
            axis.unit * np.linspace(*sweep.bounds, sweep.points),
            states,
            turns=sweep.turns,
            keep=sweep.keep,
            direction=sweep.direction,  # pyright: ignore
            dwell=seconds,  # pyright: ignore
            out=None if out is None else out / _FILE,
            resume=resume,
            progress=show(report),
            **running,
        )
        figures = []
        if out is not None:
            report("drawing", None)
            figures = [_draw(made, model, axis, sweep.section, out)]
    ranges = made.ranges()
    if words:
        output.print(words)
    output.print(_table(ranges, axis))
    sentence = _sentence(system, made, axis, sweep)
    output.print(sentence)
    output.print_figures(figures)
    output.write_json(
        {
            "command": "diagram",
            "system": system,
            "parameters": parameters(model),
            "parameter": sweep.parameter,
            "turns": sweep.turns,
            "keep": sweep.keep,
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


def _sentence(system: str, made, axis: Axis, sweep: Sweep) -> str:
    import numpy as np

    # with --dwell, fewer periods fit into the recording time at low speeds, and the
    # remaining samples are NaN
    total = int(np.prod(made.states.shape[:3]))
    if sweep.dwell is not None:
        total = int(np.isfinite(made.states[..., 0]).sum())
    failed = int(np.count_nonzero(made.dataset["code"].values))
    low, high = sweep.bounds
    count = len(made.ranges())
    ranges = "1 range" if count == 1 else f"{count} ranges, each"
    return (
        f"{system}: {total} samples, {axis.name} from {low:g} to {high:g}; "
        f"{ranges} with one type of attractor"
        + (f"; {failed} simulations failed or could not start." if failed else ".")
    )


def _table(ranges, axis: Axis):
    """Tabulate the labels in the order of the parameter values, at most 40 of them."""
    from rich.table import Table

    table = Table(title=f"Attractors against {axis.name}")
    for column in ("direction", "from", "to", "label"):
        table.add_column(column)
    words = {0: "independent", 1: "up", -1: "down"}
    for r in ranges[:40]:
        ends = (r.low, r.high) if r.direction >= 0 else (r.high, r.low)
        cells = (f"{end / axis.unit:.6g}" for end in ends)
        table.add_row(words[r.direction], *cells, r.label)
    if len(ranges) > 40:
        table.add_row("...", "", "", f"{len(ranges) - 40} more")
    return table


def _draw(made, model, axis: Axis, section: str, folder: Path) -> Path:
    from ..plotting import save_figure, sweep_diagram
    from ._stops import constant_stops

    impacts = section == "impacts"
    stops = {}
    if not impacts:
        size = made.states.shape[-1]
        stops = constant_stops(model, made.parameter, made.values, size)
    figure = sweep_diagram(
        made, phase=impacts, x_label=axis.label, x_scale=1 / axis.unit, stops=stops
    )
    return save_figure(figure, folder / "diagram.png")
