"""`jaxcam fit`: the parameters of a rig from its recordings."""

from pathlib import Path
from typing import Annotated

import typer

from ._files_options import Files
from ._grouped import grouped
from ._options import Case, OwnSystem, RigFile


@grouped
def fit(
    case: Case,
    rig: RigFile = None,
    system: OwnSystem = None,
    files: Files = Files(),
    bootstrap: Annotated[
        int,
        typer.Option(
            metavar="N",
            help="Also compute standard errors from N Bayesian bootstrap replicates.",
        ),
    ] = 0,
    iterations: Annotated[
        int | None,
        typer.Option(metavar="N", help="Maximum number of iterations; default: 60."),
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option(
            "--json",
            metavar="FILE",
            help=(
                "Write the fitted system and its standard errors to FILE, for use with "
                "--system, or to standard output if FILE is '-'."
            ),
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write the figures to DIR.")
    ] = None,
) -> None:
    """
    Fit the parameters of a rig to recordings.

    The rig is a cam-follower or any system defined in a Python file; see jaxcam
    new-rig. If CASE is a file with one impact per row (columns before_m_s and
    after_m_s), a restitution law is fitted instead.

    \b
    Examples:
      jaxcam fit demo --json fitted.json --out ./jaxcam-fit
      jaxcam simulate --system fitted.json --speed 140
      jaxcam fit ./case --system two_stops.py:TwoStops --rig two_stops.toml
      jaxcam fit impacts.csv
    """
    files.check()
    if iterations is not None and iterations < 1:
        raise ValueError(f"--iterations is {iterations}; give a positive number.")
    if bootstrap < 0 or bootstrap == 1:
        raise ValueError(f"--bootstrap is {bootstrap}; give 0, or at least 2.")

    from ._cache import keep_compiled_programs
    from ._fit_impacts import fit_impacts, is_table

    keep_compiled_programs()
    if rig is None and system is None and is_table(case, files):
        if out is not None or bootstrap or iterations is not None:
            raise ValueError(
                f"{case} is a table of impacts, for which there are no figures, no "
                "bootstrap and no iterations; leave out --out, --bootstrap and "
                "--iterations."
            )
        fit_impacts(case, files, json_file)
        return

    from ._case import notes_of, read
    from ._errors import fail, STOPPED_EARLY
    from ._fit_report import draw
    from ._fit_result import fitted, print_fit
    from ._output import Output
    from ._progress import progress
    from ._read_summary import print_summary

    runs, nominal = read(case, rig, files, system)
    output = Output(json_file, out)
    said = notes_of(runs, case)
    print_summary(output, tuple(runs), nominal, said)
    with progress("finding impacts and contacts") as report:
        found = fitted(runs, nominal, bootstrap, iterations, report)
        figures = []
        if out is not None:
            report("drawing", None)
            figures = draw(out, found.before, found.after)
    # the segmentation may add a note to a recording
    notes = notes_of([*runs, *(part.recording for part in found.segments)], case)
    print_fit(output, found, [note for note in notes if note not in said])
    output.print_figures(figures)
    about = {"case": runs.name, "notes": list(notes), "figures": figures}
    written = found.to_json(about)
    output.write_json(written)
    if json_file is not None and "not_saved" in written:
        output.print(written["not_saved"])
    if not found.after.converged:
        fail(found.after.message)
        raise typer.Exit(STOPPED_EARLY)
