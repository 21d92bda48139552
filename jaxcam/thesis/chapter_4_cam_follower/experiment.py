"""Simulate the experiment of section 4.7."""

import numpy as np

from ... import sweeps
from ...models import CamFollower, rpm_to_rad_s
from ..progress import of_sweep
from ..remember import remembered


DWELL = 60.0, 10.0
"""Waiting time and recording time at each speed (s), from section 4.7."""
UP, DOWN = (120.0, 200.0), (200.0, 150.0)
"""First and last speed (rpm) of the upward and the downward sweep."""
_STEP = {"default": 0.5, "full": 0.1}
"""Speed step (rpm); not given in the thesis."""


def _speeds(ends: tuple[float, float], step: float) -> np.ndarray:
    low, high = min(ends), max(ends)
    return np.asarray(
        rpm_to_rad_s(np.linspace(low, high, round((high - low) / step) + 1))
    )


@remembered
def experiment(system: CamFollower, size: str) -> tuple[sweeps.Diagram, sweeps.Diagram]:
    """Simulate both sweeps: the upward one from contact, and the downward one from the
    final state of the upward one.

    At each speed the cam turns for a minute; the motion is then sampled once per period
    for ten seconds, and continues at the next speed.
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
    "As in the thesis, the motion settles for a minute at each speed and is then "
    "recorded for ten seconds, with speeds increasing from 120 to 200 rpm and then "
    "decreasing to 150 rpm; the thesis does not give the speed step. The rig is "
    "simulated, so the events are those of the model; Table 5.1 also gives those of "
    "the real rig. The downward sweep ends before P(1,1) does."
)
