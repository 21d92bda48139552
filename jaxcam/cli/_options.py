"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from ..data import DEMO_RIG, PENDULUM
from ._choices import SYSTEMS


_SHIPPED = {"demo": DEMO_RIG, "pendulum": PENDULUM}


def _shipped(case: Path) -> Path:
    """Return the folder of a case; a shipped case is given by its name."""
    return case if case.exists() else _SHIPPED.get(str(case), case)


System: TypeAlias = Annotated[
    str,
    typer.Argument(
        metavar="SYSTEM", help=f"Built-in system: one of {', '.join(SYSTEMS)}."
    ),
]
SavedSystem: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--system",
        metavar="FILE",
        help="A system written by `jaxcam fit` or `jaxcam diagnose`, or your own "
        "system as FILE.py:CLASS.",
    ),
]
Preset: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help=("Parameters of the cam-follower: table-4.4 or calibrated."),
    ),
]
Assignments: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help=(
            "Set a parameter (value in SI units), such as restitution.r=0.6; can be "
            "repeated."
        ),
    ),
]
Speed: TypeAlias = Annotated[
    float | None, typer.Option(metavar="RPM", help="Speed of the cam in rpm.")
]
Lowest: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--from", metavar="A", help="Lower bound (rpm for the speed of the cam)."
    ),
]
Highest: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--to", metavar="B", help="Upper bound (rpm for the speed of the cam)."
    ),
]
Unit: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--unit",
        metavar="TEXT",
        help="Unit of the parameter, for tables and figures; default: that in the rig "
        "file.",
    ),
]
Workers: TypeAlias = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help=("Number of threads, or of local processes with --cluster local."),
    ),
]
Cluster: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Run on a Dask cluster: local, or the address of a scheduler, "
        "tcp://host:port.",
    ),
]
JsonFile: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--json",
        metavar="FILE",
        help="Write the result to FILE, or to standard output if FILE is '-'.",
    ),
]
Resume: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--resume",
        help="Resume an interrupted run from the results stored in --out DIR.",
    ),
]
Case: TypeAlias = Annotated[
    Path,
    typer.Argument(
        metavar="CASE",
        help=(
            "A folder of recordings or a single file, or the name of a case in the "
            "package: demo (simulated) or pendulum (real)."
        ),
        callback=_shipped,
    ),
]
RigFile: TypeAlias = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="The rig file; default: CASE/rig.toml."),
]
OwnSystem: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--system",
        metavar="FILE.py:CLASS",
        help="A system in your own Python file; default: the system named in the rig "
        "file.",
    ),
]
Gaps: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="Handling of missing samples and encoder slips: mend (repair them, and "
        "split at long gaps), refuse (stop with an error) or split (at every gap).",
    ),
]
