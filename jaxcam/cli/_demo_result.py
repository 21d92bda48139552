"""Compute the result of `jaxcam demo`, and write it as a page, data and text."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..discrepancy import Diagnosis
from ..recordings import merge, Rig, segment_case, Segments
from ..recordings.against_model import compare_case, Comparison
from ._case import SIMULATED
from ._demo_branches import Branches
from ._demo_figures import draw
from ._output import Output, to_text, write_text
from ._page import page, Report
from ._rests import rest_table, Rests, rests, simulate_run


@dataclasses.dataclass(frozen=True)
class DemoResult:
    """Comparison of recordings with the model of their rig, and the diagnosis."""

    case: str
    segments: Sequence[Segments]
    comparison: Comparison
    rests: list[Rests]
    figures: list[tuple[Path, str]]
    lacks: Diagnosis | None = None
    branches: Branches | None = None
    simulated: bool = False

    def kind(self) -> str:
        """Return the kind of the recordings: measured or simulated."""
        return "simulated recordings" if self.simulated else "recordings"


def compared(runs, nominal: Rig, folder: Path, report) -> DemoResult:
    """Segment the recordings, simulate their flights and the complete model, and draw
    the results.
    """
    segments = segment_case(
        tuple(runs),
        nominal,
        progress=lambda share: report("finding impacts and contacts", share),
    )
    parts, simulated = [], []
    for k, run in enumerate(segments):
        report(f"comparing {run.recording.name}", k / len(segments))
        parts.append(compare_case(nominal, [run]))
    for k, run in enumerate(segments):
        report(f"simulating {run.recording.name}", k / len(segments))
        simulated.append(simulate_run(nominal, run))
    comparison = merge(parts)
    found = [rests(run, motion) for run, motion in zip(segments, simulated)]
    report("drawing", None)
    figures = draw(folder, segments, comparison, simulated)
    return DemoResult(runs.name, segments, comparison, found, figures)


def write_result(folder: Path, found: DemoResult) -> dict[str, Any]:
    """Write index.html and result.json; return the data of the latter."""
    lacks, branches = found.lacks, found.branches
    result = {
        "command": "demo",
        "case": found.case,
        "runs": [
            {
                "name": run.recording.name,
                "speed": run.drive.speed if run.drive else None,
                "sentence": run.sentence(),
                "rests": rest.to_json(),
            }
            for run, rest in zip(found.segments, found.rests)
        ],
        "comparison": found.comparison.to_json(),
        "figures": [file.name for file, _ in found.figures],
        "branches": None if branches is None else [list(row) for row in branches.rows],
        "diagnosis": None if lacks is None else lacks.to_json(),
    }
    report = Report(
        title=f"{found.case}: {found.kind()} compared with the model",
        sentence=found.comparison.sentence(),
        lacks=None if lacks is None else lacks.summary,
        branches=branches,
        runs=[run.sentence() for run in found.segments],
        comparison=found.comparison.rows,
        rests=found.rests,
        figures=found.figures,
        next_steps=_next_steps(found.rests),
    )
    write_text(folder / "index.html", page(report))
    write_text(folder / "result.json", to_text(result) + "\n")
    return result


def print_result(output: Output, found: DemoResult) -> None:
    """Print tables and sentences to the terminal."""
    if found.simulated:
        output.print(SIMULATED)
    for run in found.segments:
        output.print(run.sentence())
    output.print(found.comparison.table())
    output.print(found.comparison.sentence())
    output.print(rest_table(found.rests))
    if found.lacks is not None:
        output.print(found.lacks.summary)
    for orbit, kind, rpm, _ in found.branches.rows if found.branches else ():
        output.print(f"{orbit}: {kind} at {rpm} rpm.")


def _next_steps(found) -> list[tuple[str, str]]:
    """Return the suggested next commands, with their purpose."""
    rpm = found[0].rpm if found else 140.0
    return [
        (
            f"jaxcam simulate cam-follower --speed {rpm:.1f} --turns 40 "
            f"--out ./jaxcam-{rpm:.1f}rpm",
            "Motion at the speed of the first recording, with the parameters of the "
            "thesis.",
        ),
        (
            f"jaxcam simulate cam-follower --speed {rpm:.1f} --set restitution.r=0.5",
            "The same motion with another coefficient of restitution.",
        ),
        (
            "jaxcam simulate --system DIR/diagnosis/model.json --speed 140",
            "Motion of the rig with the missing physics added; DIR is the folder of "
            "this page.",
        ),
        (
            "jaxcam continue --preset calibrated --from 130 --to 154 --at 145 "
            "--state 0.4245,1.828 --out ./jaxcam-branch",
            "The branch P(1,1) of this page, with all its points.",
        ),
        (
            "jaxcam new-rig cart",
            "A system of your own: edit cart.py, which contains its equations, and "
            "cart.toml, which lists its known parameters and sensors.",
        ),
        (
            "jaxcam simulate --rig cart.toml --state 0,0.8 --t1 3 --out ./cart-run",
            "The motion of that system. If your system is driven, continue with jaxcam "
            "diagram and jaxcam continue.",
        ),
        (
            "jaxcam diagnose CASE --rig cart.toml --out ./report",
            "Recordings of your own: CASE is a folder with one CSV file per recording, "
            "whose columns are time_s and the channels of cart.toml.",
        ),
        (
            "jaxcam demo --case DIR --rig DIR/rig.toml",
            "A cam-follower of your own: the columns are time_s, cam_angle_rad and "
            "follower_angle_rad.",
        ),
    ]
