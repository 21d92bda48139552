"""The rig's experiment of section 4.7, with a simulated rig."""

import numpy as np

from ... import sweeps
from ...models import CamFollower, rpm_to_rad_s
from ..progress import of_sweep
from ..remember import remembered


DWELL = 60.0, 10.0
"""S at each speed that are waited, and s that are stored (section 4.7)."""
UP, DOWN = (120.0, 200.0), (200.0, 150.0)
"""Rpm at which the speed begins and ends, on the way up and on the way down."""
_STEP = {"default": 0.5, "full": 0.1}
"""Rpm between speeds; not printed."""


def _speeds(ends: tuple[float, float], step: float) -> np.ndarray:
    low, high = min(ends), max(ends)
    return np.asarray(
        rpm_to_rad_s(np.linspace(low, high, round((high - low) / step) + 1))
    )


@remembered
def experiment(system: CamFollower, size: str) -> tuple[sweeps.Diagram, sweeps.Diagram]:
    """Both runs: up from contact, and down from where the first has ended.

    The cam turns at each speed for a minute, and then for the ten seconds that are
    stored, once per period; then the speed is another one and the motion continues.
    """
    step = _STEP[size]
    forward = sweeps.diagram(
        system,
        "speed",
        _speeds(UP, step),
        direction="up",
        dwell=DWELL,
        progress=of_sweep("sweeping the speed up"),
    )
    end = forward.dataset["final"].values[-1]
    backward = sweeps.diagram(
        system,
        "speed",
        _speeds(DOWN, step),
        end,
        direction="down",
        dwell=DWELL,
        progress=of_sweep("sweeping the speed down"),
    )
    return forward, backward


EXPERIMENT_NOTE = (
    "At each speed a minute passes and ten seconds are stored, as printed, forward "
    "from 120 to 200 rpm and backward to 150; the distance of speeds is not printed. "
    "The rig is the simulated one, so it meets the events of the model: Table 5.1 "
    "prints those of the real one, too. Backward ends before P(1,1) does."
)
