"""`jaxcam diagnose`: find the physics that a model lacks, from recordings."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from ._files_options import Files
from ._grouped import grouped
from ._options import Case, OwnSystem, Resume, RigFile


@grouped
def diagnose(
    case: Case,
    rig: RigFile = None,
    system: OwnSystem = None,
    files: Files = Files(),
    seed: Annotated[int, typer.Option(help="Seed of the block bootstrap.")] = 0,
    predict: Annotated[
        bool,
        typer.Option(
            help="Predict the bifurcation speeds of a cam-follower with the effects."
        ),
    ] = True,
    propose: Annotated[
        bool, typer.Option("--next", help="Recommend the next test speed.")
    ] = False,
    extended: Annotated[
        bool,
        typer.Option(
            "--extended", help="Also try the terms of the extended library (slower)."
        ),
    ] = False,
    minutes: Annotated[
        float | None,
        typer.Option(
            metavar="MIN",
            help="Time (min) after which no further candidate is tried; default: 20.",
        ),
    ] = None,
    resume: Resume = False,
    json_file: Annotated[
        Path | None,
        typer.Option(
            "--json",
            metavar="FILE",
            help="Write the verdict to FILE, or to standard output if FILE is '-'.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write verdict.json, model.json and index.html to DIR.",
        ),
    ] = None,
) -> None:
    """
    Determine from recordings what physics a model lacks.

    The rig is a cam-follower or any system defined in a Python file; see jaxcam
    new-rig.

    \b
    Examples:
      jaxcam diagnose demo --out ./jaxcam-diagnosis
      jaxcam diagnose pendulum --out ./pendulum-diagnosis
      jaxcam diagnose demo --json -
      jaxcam diagnose demo --next --out ./jaxcam-next
      jaxcam diagnose ./case --system two_stops.py:TwoStops --rig two_stops.toml
    """
    files.check()

    from .. import discrepancy
    from ._cache import keep_compiled_programs
    from ._case import notes_of, read
    from ._diagnose_files import write_diagnosis, write_verdict
    from ._output import Output
    from ._progress import progress
    from ._read_summary import print_summary

    keep_compiled_programs()
    runs, nominal = read(case, rig, files, system)
    _refuse_without_drive(nominal, propose)
    output, keep = Output(json_file, out), _kept_fits(out, resume)
    said = notes_of(runs, case)
    print_summary(output, tuple(runs), nominal, said)
    with progress("finding impacts and contacts") as report:
        found = discrepancy.diagnose(
            nominal,
            tuple(runs),
            "extended" if extended else None,
            case=runs.name,
            seed=seed,
            progress=report,
            keep=keep,
            policy=_policy(minutes),
        )
        notes, figures = notes_of(_recordings(runs, found), case), []
        if out is not None:
            report("drawing", None)
            figures = write_diagnosis(out, found, notes)
        outlook, failure = _outlook_or_error(
            found, nominal, predict, propose, seed, report
        )
        if out is not None:
            write_verdict(out, found, figures, notes, outlook)
    _print(output, found, [note for note in notes if note not in said], outlook)
    output.write_json({**found.to_json(), "notes": list(notes), **outlook.data()})
    if failure is not None:
        raise failure


def _recordings(runs, found):
    """Return the recordings as read, and as segmented, which may add notes."""
    return [*runs, *(part.recording for part in found.after.problem.segments)]


def _refuse_without_drive(nominal, propose: bool) -> None:
    """Raise `ValueError` if a speed is to be proposed, and the rig has no rotating
    drive.
    """
    from ..fitting import Setup

    if propose and isinstance(nominal, Setup) and nominal.drive_channel is None:
        raise ValueError(
            "--next recommends a drive speed, but this rig has no rotating drive; "
            "leave --next out, and pass simulated recordings to "
            "jaxcam.discrepancy.compare_experiments."
        )


def _policy(minutes: float | None):
    from ..discrepancy import Policy

    return Policy() if minutes is None else Policy(minutes=minutes)


def _kept_fits(out: Path | None, resume: bool) -> Path | None:
    """Return the folder that stores the fits of an interrupted diagnosis.

    Raises:
        ValueError: There is nothing to resume, or the folder contains the fits of an
            interrupted diagnosis and `resume` is false.
    """
    keep = None if out is None else out / "fits"
    if resume and (keep is None or not keep.is_dir()):
        raise ValueError(
            "--resume: there is nothing to resume; give the folder of the interrupted "
            "diagnosis with --out, or leave --resume out to start again."
        )
    if keep is not None and not resume and any(keep.rglob("*.npz")):
        raise ValueError(
            f"{keep} contains the fits of an interrupted diagnosis; add --resume to "
            "continue it, or give another folder with --out."
        )
    return keep


def _outlook_or_error(*arguments):
    """Return the outlook and no error, or an empty outlook and the reason why there is
    none: the verdict does not depend on predictions and recommendations.
    """
    from ._outlook import Outlook

    try:
        return _outlook(*arguments), None
    except ValueError as error:
        return Outlook(), error


def _outlook(found, nominal, predict: bool, propose: bool, seed: int, report):
    """Predict bifurcation speeds with and without the identified terms, and recommend
    the next recording.
    """
    from .. import discrepancy
    from ..recordings import Rig
    from ._outlook import Outlook

    outlook = Outlook()
    unknown = found.verdict == discrepancy.Verdict.UNKNOWN
    if predict and unknown and isinstance(nominal, Rig):
        outlook = Outlook(
            reason="No bifurcation speeds are predicted, because part of the missing "
            "physics is unknown."
        )
    elif predict and not unknown:
        words = "predicting with and without the missing physics"
        speeds = discrepancy.predictions(
            found, progress=lambda share: report(words, share)
        )
        outlook = Outlook(speeds)
    if propose and any(one.element is not None for one in found.missing):
        report(
            "no recording is recommended, because a force with an internal state was "
            "found",
            None,
        )
    elif propose:
        proposed = discrepancy.next_experiments(
            found, nominal, seed=seed, progress=report
        )
        outlook = dataclasses.replace(outlook, experiments=proposed)
    return outlook


def _print(output, found, notes, outlook) -> None:
    from ._diagnosis_page import held_out_error
    from ._outlook import terminal_table

    caveats = (caveat.sentence for caveat in found.caveats)
    for sentence in (*notes, found.summary, *caveats):
        output.print(sentence)
    output.print(held_out_error(found))
    for table in outlook.tables():
        output.print(terminal_table(table))
    if outlook.reason:
        output.print(outlook.reason)
    if output.folder is not None:
        output.print(f"Report: {output.folder / 'index.html'}")
        model = output.folder / "model.json"
        if model.is_file():
            output.print(f"Model: {model} (use it as --system in other commands)")
        else:
            output.print("The system has a field that cannot be saved in model.json.")
