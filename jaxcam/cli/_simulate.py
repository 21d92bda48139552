"""`jaxcam simulate`: one trajectory of a ready system."""

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from ._choices import (
    CAM,
    choose,
    ENGINES,
    make_solver,
    make_system,
    saved_name,
    SOLVERS,
    SYSTEMS,
)
from ._options import JsonFile, Preset, SavedSystem, Settings, Speed, System


def simulate(
    system: System = CAM,
    saved: SavedSystem = None,
    preset: Preset = None,
    speed: Speed = None,
    set_: Settings = None,
    state: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help="Start, such as 0.3,0, or the word release for the release point of "
            "a sticking orbit. Without: release; 1,0 for the ball; 0,0.1,-2 for the "
            "triple integrator.",
        ),
    ] = None,
    t0: Annotated[
        float, typer.Option(metavar="S", help="Start of the motion (s).")
    ] = 0.0,
    t1: Annotated[
        float | None, typer.Option(metavar="S", help="End of the motion (s).")
    ] = None,
    turns: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            help="Or its length in periods of the forcing (turns of the cam): 10.",
        ),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(metavar="E", help="Error allowed in a step.")
    ] = 1e-10,
    solver: Annotated[
        str, typer.Option(metavar="NAME", help=f"One of {', '.join(SOLVERS)}.")
    ] = "dopri8",
    engine: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="loop, or diffeqsolve: one call a flight, also for implicit solvers.",
        ),
    ] = None,
    json_file: JsonFile = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write figures there.")
    ] = None,
) -> None:
    """
    Simulate a ready system; list its impacts and contacts.

    \b
    Examples:
      jaxcam simulate cam-follower --speed 140 --turns 20
      jaxcam simulate bouncing-ball --set restitution=0.5 --state 2,0 --t1 3
      jaxcam simulate impact-oscillator --set omega=2.6 --out ./jaxcam-oscillator
    """
    if saved is not None:
        system = saved_name(saved)
    choose("SYSTEM", system, SYSTEMS)
    choose("--solver", solver, SOLVERS)
    implicit = solver.startswith("kvaerno")
    engine = engine or ("diffeqsolve" if implicit else "loop")
    choose("--engine", engine, ENGINES)

    import jaxcam

    from ._cache import keep_compiled_programs
    from ._output import Output
    from ._parameters import set_parameters
    from ._progress import progress
    from ._trajectory import about, contact_table, draw, impact_table, summary

    keep_compiled_programs()
    start = _state(system, state)
    model = set_parameters(make_system(system, preset, speed, saved), set_ or ())
    end = _end(system, model, t0, t1, turns)
    output = Output(json_file, out)
    with progress("compiling (the first run of a system takes longest)") as report:
        trajectory = jaxcam.simulate(
            model,
            start,
            t0,
            end,
            tolerance=tolerance,
            solver=make_solver(solver),
            engine=engine,  # pyright: ignore
            progress=lambda part: report("simulating", part),
        )
        figures = []
        if out is not None:
            report("drawing", None)
            figures = draw(trajectory, out)
    sentence = summary(system, trajectory)
    for table in (impact_table(trajectory), contact_table(trajectory)):
        if table is not None:
            output.print(table)
    output.print(sentence)
    if figures:
        output.print(f"Figures: {', '.join(map(str, figures))}")
    found: dict[str, Any] = {"command": "simulate", "system": system}
    found |= about(trajectory) | {"solver": solver, "engine": engine}
    output.write_json(found | {"sentence": sentence, "figures": figures})
    if not bool(trajectory.successful):
        from ._errors import fail, STOPPED_EARLY

        fail(trajectory.result)
        raise typer.Exit(STOPPED_EARLY)


def _state(name: str, text: str | None):
    """The start: None for the release point."""
    import numpy as np

    if text == "release":
        return None
    if text is None:
        start = SYSTEMS[name].state
        return None if start is None else np.array(start)
    try:
        return np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise ValueError(
            f"--state is {text!r}; give numbers with commas between them, such as "
            "0.3,0, or the word release."
        ) from None


def _end(name: str, model, t0: float, t1: float | None, turns: float | None) -> float:
    """When to stop (s)."""
    for option, value in (("--t0", t0), ("--t1", t1), ("--turns", turns)):
        if value is not None and not math.isfinite(value):
            raise ValueError(f"{option} is {value:g}; give a finite number.")
    if t1 is not None and turns is not None:
        raise ValueError("Give --t1 or --turns, not both.")
    if t1 is not None:
        return t1
    ready = SYSTEMS[name]
    turns = ready.turns if turns is None else turns
    if turns is None:
        return t0 + ready.duration
    if model.period is None:
        raise ValueError(f"{name} has no forcing to count turns of; give --t1.")
    if not turns > 0:
        raise ValueError(f"--turns is {turns:g}; give a positive number.")
    # a speed of zero would give an endless turn: let the system say so
    model.check()
    return t0 + turns * float(model.period)
