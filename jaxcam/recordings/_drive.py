"""Estimate the motion of a drive from its encoder: angle, rate, acceleration,
mean speed and clock.
"""

import dataclasses

import numpy as np
from jaxtyping import Float
from scipy.signal import savgol_filter

from ._drive_acceleration import drive_acceleration, DriveAcceleration
from ._errors import RecordingError
from ._recording import Recording


# The speed of a drive drifts over seconds and ripples once per turn; a window of 50 ms
# follows both and leaves a tenth of the encoder noise
_WINDOW = 0.05


@dataclasses.dataclass(frozen=True)
class Drive:
    """The measured motion of a drive, such as the cam of a cam-follower."""

    angle: Float[np.ndarray, " k"]
    """Smoothed angle (rad), unwrapped, positive in the sense of rotation."""
    rate: Float[np.ndarray, " k"]
    """Rate of change of the angle (rad/s)."""
    speed: float
    """Slope (rad/s) of the straight line `speed * time + phase` fitted to the angle."""
    phase: float
    """Value (rad) of the line `speed * time + phase` at time zero."""
    noise: float
    """Standard deviation of the raw samples about the smoothed angle (rad)."""
    window: int
    """Number of samples in each smoothing parabola."""
    acceleration: DriveAcceleration
    """Angular acceleration, estimated over a longer window than the rate."""

    @property
    def clock(self) -> Float[np.ndarray, " k"]:
        """Return the time (s) at which a drive of constant `speed` has the measured
        angle.

        A simulation at constant speed is compared on this clock, so that a slow drift
        of the drive speed is not attributed to a missing effect.
        """
        return (self.angle - self.phase) / self.speed


def read_drive(recording: Recording, channel: str = "cam_angle_rad") -> Drive:
    """Smooth the encoder of a drive with local parabolas over 50 ms.

    **Raises:** `RecordingError` if the recording is shorter than that, or the drive is
    at rest.
    """
    raw = recording[channel]
    if np.any(np.abs(np.diff(raw)) > np.pi):
        raw = np.unwrap(raw)
    if raw[-1] < raw[0]:
        raw = -raw
    count = int(_WINDOW / recording.interval) // 2 * 2 + 1
    if count < 5 or count > len(raw):
        raise RecordingError(
            f"{recording.name}: {len(raw)} samples {recording.interval:.3g} s apart "
            "are too few to follow the drive; give a recording that is longer than "
            f"{_WINDOW:g} s and sampled above {4 / _WINDOW:g} Hz."
        )
    angle = np.asarray(savgol_filter(raw, count, 2))
    interval = recording.interval
    rate = np.asarray(savgol_filter(raw, count, 2, deriv=1, delta=interval))
    speed, phase = np.polyfit(recording.time, raw, 1)
    if abs(angle[-1] - angle[0]) < np.pi:
        raise RecordingError(
            f"{recording.name}: the drive turns by only "
            f"{abs(angle[-1] - angle[0]):.2g} rad; give a recording of at least half "
            "a turn."
        )
    noise = float(np.std(raw - angle))
    slow = drive_acceleration(raw, count, interval, noise)
    return Drive(angle, rate, float(speed), float(phase), noise, count, slow)
