"""Records of a rig with a hidden effect, made by the scalar loop of `_numba_rig`.

Needs numba (extra `bench`).
"""

import math

from jaxcam.recordings import Recording

from ._numba_rig import simulate
from .coverage import recording


# seconds until the motion no longer depends on its initial state
SETTLE = 8.0


def hidden_records(
    real, hidden, sensors, spans_rpm, duration: float, rng
) -> tuple[Recording, ...]:
    """Records of one rig with a hidden effect, at one random speed from each range."""
    records = []
    for run, span in enumerate(spans_rpm, start=1):
        speed = rng.uniform(*span) * math.pi / 30
        truth = simulate(real, hidden, speed, duration, SETTLE)
        records.append(recording(truth, sensors, f"run{run}", rng))
    return tuple(records)
