"""`jaxcam demo`: recordings of a rig beside its simulation, and what that lacks."""

from pathlib import Path
from typing import Annotated

import typer


def demo(
    case: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="A folder of recordings, one CSV a run."),
    ] = None,
    rig: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The rig; DIR/rig.toml without."),
    ] = None,
    gaps: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Runs with samples missing: refuse them, or split."
        ),
    ] = "refuse",
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Write report and figures there.")
    ] = Path("jaxcam-demo"),
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Write the result; - to print it."),
    ] = None,
    diagnose: Annotated[
        bool,
        typer.Option(help="Say what the model lacks; takes a minute or two at first."),
    ] = True,
    branches: Annotated[
        bool,
        typer.Option(help="Follow two branches of orbits of the thesis' rig."),
    ] = True,
) -> None:
    """
    Follow orbits of a rig; compare recordings with its simulation; say what it lacks.

    Without --case, a small recording that ships with the package. The report is
    DIR/index.html, with the figures in it, and DIR/result.json; what the model lacks is
    in DIR/diagnosis.

    \b
    Examples:
      jaxcam demo
      jaxcam demo --out ./jaxcam-first-look --json - --no-diagnose --no-branches
    """
    from ._choices import choose

    choose("--gaps", gaps, ("refuse", "split"))

    from ..data import DEMO_RIG
    from ..recordings import compare_case, merge, read_case, read_rig, segment_case
    from ._beside import beside
    from ._cache import keep_compiled_programs
    from ._demo_branches import follow_branches
    from ._demo_figures import draw
    from ._output import Output, to_text, write_text
    from ._page import page, Report
    from ._progress import progress
    from ._rests import rest_table, rests, simulate_run

    keep_compiled_programs()
    folder = DEMO_RIG if case is None else case
    runs = read_case(folder, gaps=gaps)  # pyright: ignore
    nominal = read_rig(_rig_file(folder, rig))
    output = Output(json_file, out)
    with (
        beside(follow_branches, out if branches else None) as followed,
        progress("finding impacts and contacts") as report,
    ):
        segments = segment_case(tuple(runs), nominal)
        parts = []
        for k, run in enumerate(segments):
            report(f"comparing {run.recording.name}", k / len(segments))
            parts.append(compare_case(nominal, [run]))
        comparison = merge(parts)
        simulated = []
        for k, run in enumerate(segments):
            report(f"simulating {run.recording.name}", k / len(segments))
            simulated.append(simulate_run(nominal, run))
        found = [rests(run, motion) for run, motion in zip(segments, simulated)]
        report("drawing", None)
        figures = draw(out, segments, comparison, simulated)
        lacks = None
        if diagnose and len(segments) > 1:
            lacks = _diagnosed(out / "diagnosis", nominal, segments, runs.name, report)
        if branches:
            report("following branches of orbits", None)
        paths = followed()
    result = {
        "command": "demo",
        "case": runs.name,
        "runs": [
            {
                "name": run.recording.name,
                "speed": run.drive.speed if run.drive else None,
                "sentence": run.sentence(),
                "rests": rest.to_json(),
            }
            for run, rest in zip(segments, found)
        ],
        "comparison": comparison.to_json(),
        "figures": [file.name for file, _ in figures],
        "branches": None if paths is None else [list(row) for row in paths.rows],
        "diagnosis": None if lacks is None else lacks.to_json(),
    }
    report_of = Report(
        title=f"{runs.name}: recordings, simulation, and what lies between",
        sentence=comparison.sentence(),
        lacks=None if lacks is None else lacks.summary,
        branches=paths,
        runs=[run.sentence() for run in segments],
        comparison=comparison.rows,
        rests=found,
        figures=figures,
        next_steps=_next_steps(found),
    )
    write_text(out / "index.html", page(report_of))
    write_text(out / "result.json", to_text(result) + "\n")

    for run in segments:
        output.print(run.sentence())
    output.print(comparison.table())
    output.print(comparison.sentence())
    output.print(rest_table(found))
    if lacks is not None:
        output.print(lacks.summary)
    for orbit, kind, rpm, _ in paths.rows if paths is not None else ():
        output.print(f"{orbit}: {kind} at {rpm} rpm.")
    output.print(f"Report: {out / 'index.html'}")
    output.write_json(result)


def _diagnosed(folder: Path, nominal, segments, case: str, report):
    """What the model lacks, with a report of its own."""
    from .. import discrepancy
    from ._diagnose_files import write_diagnosis

    found = discrepancy.diagnose(nominal, segments, case=case, progress=report)
    report("drawing", None)
    write_diagnosis(folder, found, ())
    return found


def _rig_file(folder: Path, rig: Path | None) -> Path:
    if rig is not None:
        return rig
    file = folder / "rig.toml"
    if not file.is_file():
        raise ValueError(f"{folder}: there is no rig.toml in it; name one with --rig.")
    return file


def _next_steps(found) -> list[tuple[str, str]]:
    """What to type next, and what it is for."""
    rpm = found[0].rpm if found else 140.0
    return [
        (
            f"jaxcam simulate cam-follower --speed {rpm:.1f} --turns 40 "
            f"--out ./jaxcam-{rpm:.1f}rpm",
            "The motion of the first run with the parameters of Table 4.4.",
        ),
        (
            f"jaxcam simulate cam-follower --speed {rpm:.1f} --set restitution.r=0.5",
            "The same with another restitution.",
        ),
        (
            "jaxcam simulate --system DIR/diagnosis/model.json --speed 140",
            "The motion of the rig with what its model lacked; DIR is the folder of "
            "this page.",
        ),
        (
            "jaxcam continue --preset calibrated --from 130 --to 154 --at 145 "
            "--state 0.4245,1.828 --out ./jaxcam-branch",
            "The branch P(1,1) of this page, with all its points.",
        ),
        (
            "jaxcam demo --case DIR --rig DIR/rig.toml",
            "Recordings of your own: a folder DIR of CSV files with the columns "
            "time_s, cam_angle_rad and follower_angle_rad, and a file with the rig.",
        ),
    ]
