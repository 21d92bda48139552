"""The release from contact, at which an orbit that sticks is defined."""

import numpy as np

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.programs import program
from variational import chatter_frame


def release_of(system: HybridSystem) -> np.ndarray:
    """Return the phase of the release (forcing periods) and the state there, shape
    `(3,)`.

    Raises:
        ValueError: Contact never ends, or never begins.
    """
    frame = _frame(system)
    if not np.isfinite(float(frame.release)):
        raise ValueError(
            "this system has no release from contact in its period, so no orbit sticks "
            "for part of it; check the parameters"
        )
    phase = float(frame.release) / float(system.period)  # pyright: ignore
    return np.append(phase, np.asarray(frame.state))


@program
def _frame(system):
    return chatter_frame(system)
