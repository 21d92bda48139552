"""`jaxcam simulate`: one trajectory of a system."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ._choices import CAM, make_solver
from ._grouped import grouped
from ._options import Assignments, JsonFile, Preset, Speed, System
from ._simulate_options import RunOptions
from ._source import Source


@grouped
def simulate(
    system: System = CAM,
    source: Source = Source(),
    preset: Preset = None,
    speed: Speed = None,
    set_: Assignments = None,
    run: RunOptions = RunOptions(),
    json_file: JsonFile = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write the figures to DIR.")
    ] = None,
) -> None:
    """
    Simulate a system and list its impacts and contacts.

    \b
    Examples:
      jaxcam simulate cam-follower --speed 140 --turns 20
      jaxcam simulate bouncing-ball --set restitution=0.5 --state 2,0 --t1 3
      jaxcam simulate impact-oscillator --set omega=2.6 --out ./jaxcam-oscillator
    """
    system = source.name(system)
    run.check()

    import jaxcam

    from ._cache import keep_compiled_programs
    from ._natural_start import natural_start
    from ._output import Output
    from ._parameters import make_model
    from ._progress import COMPILING, progress
    from ._trajectory import (
        about,
        contact_table,
        draw,
        impact_table,
        span_of_history,
        summary,
    )

    keep_compiled_programs()
    start, words = run.start(system), ""
    model = make_model(system, preset, speed, source, set_)
    if source and run.state is None and (start is None or source.start() is not None):
        start, words = natural_start(model, source, run.t0)
    end = run.end(system, model)
    output = Output(json_file, out)
    with progress(COMPILING) as report:
        trajectory = jaxcam.simulate(
            model,
            start,
            run.t0,
            end,
            tolerance=run.tolerance,
            solver=make_solver(run.solver),
            engine=run.chosen_engine,  # pyright: ignore
            progress=lambda part: report("simulating", part),
        )
        figures = []
        if out is not None:
            report("drawing", None)
            figures = draw(trajectory, out)
    sentence = summary(system, trajectory)
    if words:
        output.print(words)
    for table in (impact_table(trajectory), contact_table(trajectory)):
        if table is not None:
            output.print(table)
    output.print(sentence)
    output.print_figures(figures)
    if figures and (span := span_of_history(trajectory)):
        output.print(span)
    found: dict[str, Any] = {"command": "simulate", "system": system}
    found |= about(trajectory) | {"solver": run.solver, "engine": run.chosen_engine}
    output.write_json(found | {"sentence": sentence, "figures": figures})
    if not bool(trajectory.successful):
        from ._errors import fail, STOPPED_EARLY

        fail(trajectory.result)
        raise typer.Exit(STOPPED_EARLY)
