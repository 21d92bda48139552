"""`jaxcam fit`: the parameters of a cam-follower rig from its recordings."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ._options import Case, Gaps, RigFile


def fit(
    case: Case,
    rig: RigFile = None,
    gaps: Gaps = "mend",
    bootstrap: Annotated[
        int,
        typer.Option(
            metavar="N", help="Weight the flights at random N times for another error."
        ),
    ] = 0,
    json_file: Annotated[
        Path | None,
        typer.Option(
            "--json",
            metavar="FILE",
            help="Write the fitted system and its errors, for --system; - prints it.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write figures there.")
    ] = None,
) -> None:
    """
    Fit the parameters of a cam-follower rig to recordings of it.

    \b
    Examples:
      jaxcam fit demo --json fitted.json --out ./jaxcam-fit
      jaxcam simulate --system fitted.json --speed 140
    """
    from ._choices import choose

    choose("--gaps", gaps, ("mend", "refuse", "split"))
    if bootstrap < 0 or bootstrap == 1:
        raise ValueError(f"--bootstrap is {bootstrap}; give 0, or at least 2.")

    from .. import fitting
    from ..models import system_to_json
    from ..recordings import read_case, read_rig, segment_case
    from ._cache import keep_compiled_programs
    from ._demo import _rig_file
    from ._fit_report import correlation_table, draw, parameter_table
    from ._output import Output
    from ._progress import progress

    keep_compiled_programs()
    runs = read_case(case, gaps=gaps)  # pyright: ignore
    nominal = read_rig(_rig_file(case, rig))
    output = Output(json_file, out)
    notes = [n for run in runs for n in run.meta.get("notes", ())]
    with progress("finding impacts and contacts") as report:
        segments = segment_case(tuple(runs), nominal)
        report("preparing the fit", None)
        problem = fitting.Problem.build(
            fitting.cam_follower_model(nominal),
            segments,
            fitting.cam_follower_parameters(nominal),
        )
        before = fitting.fit(problem, free=())
        seen = fitting.identify(problem, at=before)
        found = fitting.fit(
            problem, progress=lambda k, cost: report(f"fitting, step {k}", None)
        )
        laws = fitting.restitution_laws(segments)
        again = None
        if bootstrap:
            again = fitting.bootstrap(
                found,
                bootstrap,
                progress=lambda k, n: report("weighting flights", k / n),
            )
        figures = []
        if out is not None:
            report("drawing", None)
            figures = draw(out, before, found)
    quality = [
        {"record": part.record, "channel": part.channel, "rms": part.rms}
        | {"noise": part.noise, "ratio": part.rms / part.noise}
        for part in fitting.residuals(found)
    ]
    for note in dict.fromkeys(notes):
        output.print(note)
    for sentence in seen.sentences():
        output.print(sentence)
    output.print(parameter_table(problem, found, again))
    output.print(correlation_table(found))
    output.print(found.most_correlated())
    for law in laws.values():
        output.print(law.sentence())
    ratio = sum(q["ratio"] for q in quality) / len(quality)
    sentence = (
        f"{found.message} {problem.samples} samples of {len(problem.records)} records "
        f"are left with {ratio:.3f} times the noise of the sensors."
    )
    output.print(sentence)
    if figures:
        output.print(f"Figures: {', '.join(map(str, figures))}")
    fitted: dict[str, Any] = found.to_json()
    fitted |= {
        "case": runs.name,
        "sentence": sentence,
        "notes": list(dict.fromkeys(notes)),
        "identifiability": seen.sentences(),
        "most_correlated": found.most_correlated(),
        "residuals": quality,
        "restitution": {name: law.sentence() for name, law in laws.items()},
        "figures": figures,
    }
    if again is not None:
        fitted["bootstrap_stderr"] = again.stderr
    # the rig as a whole: the encoder's zero is the geometry's, the speed is free
    drive = segments[0].drive
    assert drive is not None
    system = found.model(0).driven(0.0, 0.0 * drive.phase, drive.speed)
    output.write_json(system_to_json(system, about=fitted))
    if not found.converged:
        from ._errors import fail, STOPPED_EARLY

        fail(found.message)
        raise typer.Exit(STOPPED_EARLY)
