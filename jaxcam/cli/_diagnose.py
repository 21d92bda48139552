"""`jaxcam diagnose`: what physics a rig's model leaves out, from its recordings."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from ._options import Case, Gaps, Resume, RigFile


def diagnose(
    case: Case,
    rig: RigFile = None,
    gaps: Gaps = "mend",
    seed: Annotated[int, typer.Option(help="Of the redrawn stretches.")] = 0,
    predict: Annotated[
        bool,
        typer.Option(
            help="Speeds at which the motion changes, with and without what was found."
        ),
    ] = True,
    propose: Annotated[
        bool,
        typer.Option("--next", help="Which record to make next, by its speed."),
    ] = False,
    resume: Resume = False,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="The verdict; - prints it."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write verdict.json, model.json and index.html here.",
        ),
    ] = None,
) -> None:
    """
    Say what physics the model of a cam-follower rig leaves out.

    \b
    Examples:
      jaxcam diagnose demo --out ./jaxcam-diagnosis
      jaxcam diagnose demo --json -
      jaxcam diagnose demo --next --out ./jaxcam-next
    """
    from ._choices import choose

    choose("--gaps", gaps, ("mend", "refuse", "split"))

    from .. import discrepancy
    from ..recordings import read_case, read_rig
    from ._cache import keep_compiled_programs
    from ._demo import _rig_file
    from ._diagnose_files import write_diagnosis, write_verdict
    from ._outlook import Outlook, terminal_table
    from ._output import Output
    from ._progress import progress

    keep_compiled_programs()
    runs = read_case(case, gaps=gaps)  # pyright: ignore
    nominal = read_rig(_rig_file(case, rig))
    output = Output(json_file, out)
    keep = None if out is None else out / "fits"
    if resume and (keep is None or not keep.is_dir()):
        raise ValueError(
            "--resume: there is nothing to go on with; give --out the folder of a run "
            "that was stopped, or leave --resume out to begin anew."
        )
    if keep is not None and not resume and any(keep.glob("*.npz")):
        raise ValueError(
            f"{keep} holds the fits of a run that was stopped; add --resume to go on "
            f"with it, or give another folder to --out."
        )
    notes = dict.fromkeys(n for run in runs for n in run.meta.get("notes", ()))
    with progress("finding impacts and contacts") as report:
        found = discrepancy.diagnose(
            nominal,
            tuple(runs),
            case=runs.name,
            seed=seed,
            progress=report,
            keep=keep,
        )
        outlook, figures = Outlook(), []
        if out is not None:
            report("drawing", None)
            figures = write_diagnosis(out, found, tuple(notes))
        if predict and found.verdict != "unknown":
            report("predicting with and without", None)
            outlook = Outlook(discrepancy.predictions(found))
        if propose:
            proposed = discrepancy.next_experiments(
                found, nominal, seed=seed, progress=report
            )
            outlook = dataclasses.replace(outlook, experiments=proposed)
        if out is not None:
            write_verdict(out, found, figures, tuple(notes), outlook)
    for note in notes:
        output.print(note)
    output.print(found.summary)
    for caveat in found.caveats:
        output.print(caveat)
    output.print(
        f"On records not seen: {found.heldout_before:.3e} {found.unit} before, "
        f"{found.heldout_after:.3e} after, noise {found.noise_floor:.3e}."
    )
    for table in outlook.tables():
        output.print(terminal_table(table))
    if out is not None:
        output.print(f"Report: {out / 'index.html'}")
        output.print(f"Model: {out / 'model.json'}, for --system of other commands")
    output.write_json({**found.to_json(), **outlook.data()})
