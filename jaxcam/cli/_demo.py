"""`jaxcam demo`: recordings of a rig compared with its model, and a diagnosis."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from ._options import JsonFile


def demo(
    case: Annotated[
        Path | None,
        typer.Option(
            metavar="CASE",
            help="A folder of cam-follower recordings, one CSV file per recording; "
            "default: the simulated recordings in the package.",
        ),
    ] = None,
    rig: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The rig file; default: CASE/rig.toml."),
    ] = None,
    gaps: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Handling of recordings with missing samples: refuse (stop with an "
            "error) or split (divide at every gap).",
        ),
    ] = "refuse",
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help=("Write the report and its figures to DIR.")),
    ] = Path("jaxcam-demo"),
    json_file: JsonFile = None,
    diagnose: Annotated[
        bool,
        typer.Option(
            help=("Diagnose the model; the first run takes one or two minutes.")
        ),
    ] = True,
    branches: Annotated[
        bool,
        typer.Option(
            help="Also follow two branches of periodic orbits of the cam-follower."
        ),
    ] = True,
) -> None:
    """
    Compare recordings with a model, diagnose the model and follow periodic orbits.

    By default, the simulated recordings shipped with the package are used. The report
    is written to DIR/index.html, the data to DIR/result.json, and the diagnosis to
    DIR/diagnosis.

    \b
    Examples:
      jaxcam demo
      jaxcam demo --out ./jaxcam-first-look --json - --no-diagnose --no-branches
    """
    from ._choices import choose

    choose("--gaps", gaps, ("refuse", "split"))

    from ..data import DEMO_RIG
    from ..recordings import Rig
    from ._beside import beside
    from ._cache import keep_compiled_programs
    from ._case import origin_of, read
    from ._demo_branches import follow_branches
    from ._demo_result import compared, print_result, write_result
    from ._files_options import Files
    from ._output import Output
    from ._progress import progress

    keep_compiled_programs()
    folder = DEMO_RIG if case is None else case
    origin = origin_of(folder)
    runs, nominal = read(folder, rig, Files(gaps))
    if not isinstance(nominal, Rig):
        raise ValueError(
            f"{case} is not a cam-follower rig, which jaxcam demo requires; use "
            "jaxcam fit or jaxcam diagnose for a rig of your own."
        )
    output = Output(json_file, out)
    with (
        beside(follow_branches, out if branches else None) as followed,
        progress("finding impacts and contacts") as report,
    ):
        found = compared(runs, nominal, out, report)
        lacks = None
        if diagnose and len(found.segments) > 1:
            lacks = _diagnosed(out / "diagnosis", nominal, found, origin, report)
        if branches:
            report("following branches of orbits", None)
        found = dataclasses.replace(
            found, lacks=lacks, branches=followed(), simulated=bool(origin)
        )
    result = write_result(out, found)
    print_result(output, found)
    output.print(f"Report: {out / 'index.html'}")
    output.write_json(result)


def _diagnosed(folder: Path, nominal, found, notes, report):
    """Diagnose the model discrepancy, and write a separate report."""
    from .. import discrepancy
    from ._diagnose_files import write_diagnosis

    lacks = discrepancy.diagnose(
        nominal, found.segments, case=found.case, progress=report
    )
    report("drawing", None)
    write_diagnosis(folder, lacks, notes)
    return lacks
