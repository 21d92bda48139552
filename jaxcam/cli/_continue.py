"""`jaxcam continue`: follow a periodic orbit and find its bifurcations."""

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from ._choices import CAM, choose, make_system, saved_name, SYSTEMS
from ._options import (
    Highest,
    JsonFile,
    Lowest,
    Preset,
    Resume,
    SavedSystem,
    Settings,
    System,
)


ALGORITHMS = {
    "pseudo-arclength": "PseudoArclength",
    "moore-penrose": "MoorePenrose",
    "natural": "Natural",
}
DIRECTIONS = {"up": 1, "down": -1, "both": "both"}
_FILE = "branch.jsonl"


def continue_(
    system: System = CAM,
    parameter: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="The parameter that varies, such as speed or wall or "
            "profile.eccentricity.",
        ),
    ] = "speed",
    low: Lowest = None,
    high: Highest = None,
    at: Annotated[
        float | None,
        typer.Option(
            metavar="P", help="Its value at the start; without, that of the system."
        ),
    ] = None,
    preset: Preset = None,
    saved: SavedSystem = None,
    set_: Settings = None,
    state: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help="A guess of the orbit's state at time zero, such as 0.3,0. Without: "
            "the orbit that the motion settles on.",
        ),
    ] = None,
    periods: Annotated[
        int | None,
        typer.Option(metavar="N", help="Forcing periods until the orbit repeats."),
    ] = None,
    direction: Annotated[
        str, typer.Option(metavar="NAME", help=f"One of {', '.join(DIRECTIONS)}.")
    ] = "both",
    algorithm: Annotated[
        str, typer.Option(metavar="NAME", help=f"One of {', '.join(ALGORITHMS)}.")
    ] = "pseudo-arclength",
    max_points: Annotated[
        int, typer.Option(metavar="N", help="Points in each direction.")
    ] = 300,
    json_file: JsonFile = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the branch and its figure there."),
    ] = None,
    resume: Resume = False,
) -> None:
    """
    Follow a periodic orbit in a parameter; list its bifurcations.

    \b
    Examples:
      jaxcam continue cam-follower --from 130 --to 160 --at 145 --state 0.545,0.37
      jaxcam continue impact-oscillator --parameter omega --from 2 --to 3 --at 2.2
      jaxcam continue cam-follower --from 130 --to 150 --out DIR --resume
    """
    if saved is not None:
        system = saved_name(saved)
    choose("SYSTEM", system, SYSTEMS)
    choose("--direction", direction, DIRECTIONS)
    choose("--algorithm", algorithm, ALGORITHMS)
    low, high = _bounds(low, high)
    if periods is not None and periods < 1:
        raise ValueError(f"--periods is {periods}; give 1 or more.")
    if max_points < 2:
        raise ValueError(f"--max-points is {max_points}; give 2 or more.")
    if resume and out is None:
        raise ValueError("--resume needs the folder of the interrupted run: --out DIR.")
    if out is not None and not resume:
        _refuse_interrupted(out / _FILE)

    import continuation

    from ..models import rad_s_to_rpm
    from ._cache import keep_compiled_programs
    from ._output import Output
    from ._parameters import parameters, pick, set_parameters
    from ._progress import progress

    keep_compiled_programs()
    model = set_parameters(make_system(system, preset, None, saved), set_ or ())
    # speeds are rpm at the command line and rad/s inside
    unit = math.pi / 30 if parameter == "speed" and system == CAM else 1.0
    model = _started(model, parameter, at, unit, low, high)
    guess = _guess(state)
    output = Output(json_file, out)
    settings = continuation.Settings(max_points=max_points)
    with progress("finding the orbit (the first run takes longest)") as report:
        start = continuation.periodic_orbits(model, guess, periods)
        report("following the branch", None)

        def show(point) -> None:
            report(f"{parameter} = {point.parameter / unit:.6g}", None)

        branch = continuation.branch(
            start.problem,
            start,
            pick(parameter),
            (unit * low, unit * high),
            getattr(continuation, ALGORITHMS[algorithm])(),
            settings=settings,
            direction=DIRECTIONS[direction],
            callbacks=[show],
            out=None if out is None else out / _FILE,
            resume=resume,
        )
        figures = []
        if out is not None:
            report("drawing", None)
            figures = [_draw(branch, model, parameter, unit, out)]
    shown = ("speed (rpm)", 1 / unit) if unit != 1.0 else None
    output.print(continuation.table(branch, shown=shown))
    count = len(branch.regular)
    kinds = [point.kind for point in branch.special]
    found = ", ".join(f"{kinds.count(k)} {k}" for k in dict.fromkeys(kinds)) or "none"
    name = "speed in rpm" if unit != 1.0 else parameter
    reached = [p.parameter / unit for p in branch.points]
    sentence = (
        f"{system}: {count} points, {name} from {min(reached):.6g} to "
        f"{max(reached):.6g}; special points: {found}."
    )
    output.print(sentence)
    if figures:
        output.print(f"Figures: {', '.join(map(str, figures))}")
    points = [_plain(point) for point in branch.points]
    if unit != 1.0:
        for row in points:
            row["rpm"] = float(rad_s_to_rpm(row["parameter"]))
    output.write_json(
        {
            "command": "continue",
            "system": system,
            "parameters": parameters(model),
            "parameter": parameter,
            "algorithm": algorithm,
            "points": points,
            "special": [row for row in points if row["special"]],
            "ended": branch.reason,
            "sentence": sentence,
            "figures": figures,
        }
    )


def _refuse_interrupted(path: Path) -> None:
    """**Raises:** `ValueError` where the branch that a folder holds has no end."""
    import continuation

    for file in (path, path.with_suffix(f".back{path.suffix}")):
        try:
            points = continuation.load(file).points if file.is_file() else ()
        except ValueError:
            # no branch, so nothing is lost
            continue
        if points and points[-1].kind != "end":
            raise ValueError(
                f"{file} holds a branch that was interrupted; add --resume to go on "
                f"with it, or give another folder to --out."
            )


def _bounds(low: float | None, high: float | None) -> tuple[float, float]:
    if low is None or high is None:
        raise ValueError(
            "Give the lowest and the highest value of the parameter: --from A --to B."
        )
    for option, value in (("--from", low), ("--to", high)):
        if not math.isfinite(value):
            raise ValueError(f"{option} is {value:g}; give a finite number.")
    if not low < high:
        raise ValueError(
            f"--from {low:g} --to {high:g} is the wrong way round; give the lower "
            "value first and choose --direction."
        )
    return low, high


def _started(model, name: str, at: float | None, unit: float, low, high):
    """The system with the parameter at its first value.

    **Raises:** `ValueError` for a parameter that does not exist, or a start outside.
    """
    import equinox as eqx
    import jax.numpy as jnp

    from ._parameters import parameters, pick

    known = {k: v for k, v in parameters(model).items() if not isinstance(v, list)}
    if name not in known:
        raise ValueError(
            f"--parameter {name}: there is no such parameter; the parameters are "
            f"{', '.join(known)}."
        )
    value = known[name] / unit if at is None else at
    if not low <= value <= high:
        raise ValueError(
            f"the branch starts at {name} = {value:g}, outside {low:g} to {high:g}; "
            "choose the start with --at, or other bounds."
        )
    return eqx.tree_at(pick(name), model, jnp.asarray(unit * value, dtype=float))


def _guess(text: str | None):
    import numpy as np

    if text is None:
        return None
    try:
        return np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise ValueError(
            f"--state is {text!r}; give numbers with commas between them, such as "
            "0.3,0."
        ) from None


def _plain(point) -> dict[str, Any]:
    observed = {
        name: point.observed[name]
        for name in ("period", "time", "state", "stroboscopic", "sticking time")
        if name in point.observed
    }
    return {
        "label": point.label,
        "kind": point.kind,
        "special": point.special,
        "parameter": point.parameter,
        "stable": point.stable,
        "converged": point.converged,
        "multipliers": [[float(m.real), float(m.imag)] for m in point.multipliers],
        "signature": point.signature,
        "reason": point.reason,
        "coefficient": point.coefficient,
        **observed,
    }


def _draw(branch, model, name: str, unit: float, folder: Path) -> Path:
    from ..plotting import branch_diagram, save_figure

    names, units = model.state_names, model.state_units
    figure = branch_diagram(
        branch,
        x_label=("speed", "rpm") if unit != 1.0 else (name, "-"),
        y_label=(names[0], units[0]) if names else ("state", "-"),
        x_scale=1 / unit,
    )
    return save_figure(figure, folder / "branch.png")
