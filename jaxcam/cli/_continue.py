"""`jaxcam continue`: follow a periodic orbit and find its bifurcations."""

from collections.abc import Callable, Sequence
from math import isinf, isnan
from pathlib import Path
from typing import Annotated, Any

import typer

from ._axis import Axis
from ._checks import check_resume
from ._choices import CAM
from ._continue_options import ALGORITHMS, BranchRange, DIRECTIONS, Following
from ._grouped import grouped
from ._options import Assignments, JsonFile, Preset, Resume, System
from ._source import Source


_FILE = "branch.jsonl"


@grouped
def continue_(
    system: System = CAM,
    along: BranchRange = BranchRange(),
    preset: Preset = None,
    source: Source = Source(),
    set_: Assignments = None,
    following: Following = Following(),
    json_file: JsonFile = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the branch and its figure to DIR."),
    ] = None,
    resume: Resume = False,
) -> None:
    """
    Follow a branch of periodic orbits in a parameter and list its bifurcations.

    \b
    Examples:
      jaxcam continue cam-follower --from 130 --to 160 --at 145 --state 0.545,0.37
      jaxcam continue impact-oscillator --parameter omega --from 2 --to 3 --at 2.2
      jaxcam continue cam-follower --from 130 --to 150 --out DIR --resume
    """
    system = source.name(system)
    following.check()
    low, high = along.bounds
    check_resume(resume, out)
    if out is not None and not resume:
        _refuse_interrupted(out / _FILE)

    import continuation

    from ._cache import keep_compiled_programs
    from ._output import Output
    from ._parameters import chosen_parameter, make_model, parameters, pick_by_name
    from ._progress import progress

    keep_compiled_programs()
    axis = Axis.of(along.parameter, system, source.units(), along.unit)
    model = along.started(make_model(system, preset, None, source, set_), axis)
    guess = following.guess
    output = Output(json_file, out)
    with progress("finding the orbit (the first run takes longest)") as report:
        start = continuation.periodic_orbits(model, guess, periods=following.periods)
        report("following the branch", None)

        def show(point) -> None:
            report(f"{along.parameter} = {axis.shown(point.parameter)}", None)

        branch = continuation.branch(
            start.problem,
            start,
            pick_by_name(chosen_parameter(model, along.parameter)),
            (axis.unit * low, axis.unit * high),
            getattr(continuation, ALGORITHMS[following.algorithm])(),
            settings=continuation.BranchSettings(max_points=following.max_points),
            direction=DIRECTIONS[following.direction],
            callbacks=[show],
            out=None if out is None else out / _FILE,
            resume=resume,
        )
        figures = []
        if out is not None:
            report("drawing", None)
            figures = [_draw(branch, model, axis, out)]
    name = f"{along.parameter} ({axis.symbol})"
    shown = (name, 1 / axis.unit) if axis.symbol else None
    columns = _columns(model.state_names)
    output.print(continuation.table(branch, shown=shown, columns=columns))
    for point in branch.points:
        if point.kind != "regular" and point.reason:
            output.print(f"{point.label} ({point.kind}): {point.reason}")
    sentence = _sentence(system, branch, axis)
    output.print(sentence)
    output.print_figures(figures)
    points = [_plain(point, axis) for point in branch.points]
    output.write_json(
        {
            "command": "continue",
            "system": system,
            "parameters": parameters(model),
            "parameter": along.parameter,
            "algorithm": following.algorithm,
            "points": points,
            "special": [row for row in points if row["special"]],
            "ended": branch.reason,
            "sentence": sentence,
            "figures": figures,
        }
    )


def _refuse_interrupted(path: Path) -> None:
    """Reject a folder with an interrupted branch.

    Raises:
        ValueError: The folder contains an interrupted branch.
    """
    import continuation

    for file in (path, path.with_suffix(f".back{path.suffix}")):
        try:
            points = continuation.load_branch(file).points if file.is_file() else ()
        except ValueError:
            # the file does not contain a branch, so it may be overwritten
            continue
        if points and points[-1].kind != "end":
            raise ValueError(
                f"{file} contains an interrupted branch; add --resume to continue it, "
                "or give another folder with --out."
            )


def _columns(names: Sequence[str]) -> dict[str, Callable[[Any], complex | None]]:
    """Return the columns that describe an orbit: the state sampled at a whole forcing
    period, and the multiplier of largest modulus.

    **Arguments:** names of the state components.
    """

    def component(k: int):
        def value(point):
            states = point.observed.get("stroboscopic")
            return None if states is None else float(states[0][k])

        return value

    def largest(point):
        first = max(point.multipliers, key=abs, default=None)
        if first is None or isnan(abs(first)):
            return None
        # an infinite multiplier is real
        plain = first.imag == 0 or isinf(abs(first))
        return float(first.real) if plain else complex(first)

    found = {name: component(k) for k, name in enumerate(names[:3])}
    return found | {"largest multiplier": largest}


def _sentence(system: str, branch, axis: Axis) -> str:
    kinds = [point.kind for point in branch.special]
    found = ", ".join(f"{kinds.count(k)} {k}" for k in dict.fromkeys(kinds)) or "none"
    reached = [p.parameter / axis.unit for p in branch.points]
    return (
        f"{system}: {len(branch.regular)} points, {axis.name} from {min(reached):.6g} "
        f"to {max(reached):.6g}; special points: {found}."
    )


def _plain(point, axis: Axis) -> dict[str, Any]:
    from ..models import rad_s_to_rpm

    row = {
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
    }
    for name in ("period", "time", "state", "stroboscopic", "sticking time"):
        if name in point.observed:
            row[name] = point.observed[name]
    if axis.in_rpm:
        row["rpm"] = float(rad_s_to_rpm(point.parameter))
    return row


def _draw(branch, model, axis: Axis, folder: Path) -> Path:
    from ..plotting import branch_diagram, save_figure

    names, units = model.state_names, model.state_units
    figure = branch_diagram(
        branch,
        x_label=axis.label,
        y_label=(names[0] if names else "state", units[0] if units else ""),
        x_scale=1 / axis.unit,
    )
    return save_figure(figure, folder / "branch.png")
