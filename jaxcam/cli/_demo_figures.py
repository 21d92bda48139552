"""The figures of `jaxcam demo`."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib

from ..hybrid import Trajectory
from ..models import rad_s_to_rpm
from ..recordings import Segments
from ..recordings.against_model import Comparison
from ._trajectory import last


matplotlib.use("Agg")

from .. import plotting


def draw(
    folder: Path,
    runs: Sequence[Segments],
    comparison: Comparison,
    simulated: Sequence[Trajectory],
) -> list[tuple[Path, str]]:
    """Write all figures, and return each with its caption."""
    found = []

    def keep(figure, name: str, caption: str) -> None:
        found.append((plotting.save_figure(figure, folder / f"{name}.png"), caption))

    for run in runs:
        assert run.drive is not None and run.surface is not None
        name = run.recording.name
        if not any(part.record == name for part in comparison.residuals):
            continue
        figure = plotting.compare_recording(
            run.recording,
            comparison,
            contact=run.surface.angle(run.drive.angle),
            noise=run.noise,
        )
        keep(
            figure,
            f"recording_{name}",
            f"{name}: recorded motion, and each flight simulated from its measured "
            "initial state.",
        )
    if comparison.residuals:
        for against in ("time", "phase"):
            figure = plotting.residual_by_mode(comparison, against=against)
            keep(
                figure,
                f"residual_by_mode_{against}",
                f"Recording minus model by mode, against {_AGAINST[against]}. The band "
                "is +-2 standard deviations of the noise.",
            )
    for motion in _slowest_and_fastest(simulated):
        rpm = float(rad_s_to_rpm(motion.system.speed))  # pyright: ignore
        at = f"{rpm:.1f} rpm"
        keep(
            plotting.time_history(motion, between=last(motion, 4.0)),
            f"time_history_{rpm:.1f}rpm",
            f"The nominal rig at {at}: the last cycles of the simulated motion.",
        )
        keep(
            plotting.phase_portrait(motion, between=last(motion, 12.0)),
            f"phase_portrait_{rpm:.1f}rpm",
            f"The nominal rig at {at}: velocity against angle.",
        )
    return found


_AGAINST = {"time": "time", "phase": "cam angle within one turn"}


def _slowest_and_fastest(simulated: Sequence[Trajectory]) -> list[Trajectory]:
    ordered = sorted(simulated, key=lambda motion: float(motion.system.speed))  # pyright: ignore
    return [ordered[0], ordered[-1]] if len(ordered) > 1 else list(ordered)
