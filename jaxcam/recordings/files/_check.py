"""Check the numbers of a recording; each error message is one sentence."""

import numpy as np
from jaxtyping import Float, Int

from .._errors import RecordingError
from .._recording import Recording


# Allowed relative difference between the measured speed and that in the file name;
# errors of encoders and clocks are much smaller
_SPEED_TOLERANCE = 0.05
# Largest follower angle (rad): the follower stays below the vertical, and values in
# degrees exceed this limit
_FOLLOWER_RANGE = np.pi / 2
# If at least this number, and more than this fraction, of the samples have the time of
# the one before, the times are rounded
_FEW, _ROUNDED = 5, 0.01
# Smallest plausible sampling interval (s), below that of any encoder or gyro
_SHORTEST = 1e-9

_DEGREES = "multiply it by pi/180 or name the column `{}_deg`"


def find_gaps(
    name: str, time: Float[np.ndarray, " k"], gaps: str
) -> Int[np.ndarray, " pieces"]:
    """Return the index of the first sample after each gap in time.

    **Raises:** `RecordingError` if time does not increase, or if there is a gap and
    `gaps` is not `"split"`.
    """
    if gaps not in ("refuse", "split"):
        raise RecordingError(f'gaps is "refuse", "split" or "mend", not {gaps!r}.')
    if len(time) < 2:
        raise RecordingError(f"{name}: one sample is not a recording; remove it.")
    steps = np.diff(time)
    back = np.flatnonzero(steps <= 0)
    if len(back):
        row = int(back[0])
        if np.all(steps == 0):
            raise RecordingError(
                f"{name}: all times are {time[0]:.10g} s; check which column contains "
                "the time."
            )
        many = len(back) >= _FEW and len(back) > _ROUNDED * len(steps)
        if many and not np.any(steps < 0):
            rate = len(steps) / float(time[-1] - time[0])
            raise RecordingError(
                f"{name}: {len(back)} samples have the same time as the one before, so "
                f"the times seem to be rounded. If the samples are equidistant, leave "
                f"the time column out (--columns=-,NAME,..., with `-` for the time) "
                f"and give the sampling rate (--rate {rate:.6g})."
            )
        raise RecordingError(
            f"{name}: time does not increase from row {row + 1} ({time[row]:.10g} s) "
            f"to row {row + 2} ({time[row + 1]:.10g} s); sort the rows, or keep one of "
            f"those with the same time."
        )
    usual = float(np.median(steps))
    if usual < _SHORTEST:
        raise RecordingError(
            f"{name}: samples are {usual:.3g} s apart, which is too fast for a "
            "sensor; check the unit of time."
        )
    found = np.flatnonzero(steps > 1.5 * usual)
    if len(found) and gaps == "refuse":
        first = int(found[0])
        many = "a gap" if len(found) == 1 else f"the first of {len(found)} gaps"
        raise RecordingError(
            f"{name}: there is {many} in time at {time[first]:.6g} s, "
            f"{steps[first]:.4g} s long, whereas samples are {usual:.4g} s apart; read "
            f'the file with gaps="split" to use the pieces as separate recordings, or '
            f'with gaps="mend" to bridge short gaps.'
        )
    return found + 1


def check_channels(recording: Recording) -> None:
    """Check that the channels of a recording are plausible for their names.

    Args:
        recording: The recording.

    Raises:
        RecordingError: A channel is constant, or an angle appears to be in degrees.

    Examples:
        >>> from jaxcam.recordings import Recording, RecordingError
        >>> from jaxcam.recordings.files import check_channels
        >>> stuck = Recording("run", 0.1 * np.arange(5), {"angle_rad": np.full(5, 0.3)})
        >>> try:
        ...     check_channels(stuck)
        ... except RecordingError as error:
        ...     print(str(error).partition(";")[0])
        run: the channel `angle_rad` is 0.3 throughout
    """
    for name, samples in recording.channels.items():
        # A force or a reference may be constant, but the motion itself may not
        if name.endswith(("_rad", "_rad_s")) and np.ptp(samples) == 0:
            raise RecordingError(
                f"{recording.name}: the channel `{name}` is {samples[0]:g} throughout; "
                f"check that its sensor is connected, or remove the column."
            )
    follower = recording.channels.get("follower_angle_rad")
    if follower is not None and np.max(np.abs(follower)) > _FOLLOWER_RANGE:
        top = float(np.max(np.abs(follower)))
        hint = _DEGREES.format("follower_angle")
        raise RecordingError(
            f"{recording.name}: `follower_angle_rad` reaches {top:.3g}, which looks "
            f"like degrees; {hint}."
        )


def check_drive(recording: Recording) -> None:
    """Compare the cam speed with the one in the file name.

    Args:
        recording: The recording.

    Raises:
        RecordingError: The speeds differ; the message names the unit suggested by the
            numbers.

    Examples:
        >>> from jaxcam.recordings import Recording, RecordingError
        >>> from jaxcam.recordings.files import check_drive
        >>> time = 1e-3 * np.arange(1000)
        >>> degrees = {"cam_angle_rad": 573.0 * time}  # 573 degrees/s are 10 rad/s
        >>> try:
        ...     check_drive(Recording("run", time, degrees, nominal_speed=10.0))
        ... except RecordingError as error:
        ...     print(str(error).partition(";")[0])
        run: `cam_angle_rad` looks like degrees
    """
    angle = recording.channels.get("cam_angle_rad")
    nominal = recording.nominal_speed
    if angle is None or nominal is None:
        return
    wrapped = np.abs(np.diff(angle)) > np.pi
    if np.any(wrapped):
        angle = np.unwrap(angle)
    speed = float(angle[-1] - angle[0]) / recording.duration
    ratio = abs(speed) / nominal if nominal > 0 else np.inf
    if abs(ratio - 1) <= _SPEED_TOLERANCE:
        return
    # in another unit, jumps from one revolution to the next are not recognised, but
    # they leave the median step unchanged
    step = float(np.median(np.diff(recording.channels["cam_angle_rad"])))
    typical = abs(step) / recording.interval / nominal if nominal > 0 else np.inf
    looks = {
        180 / np.pi: f"`cam_angle_rad` looks like degrees; {_DEGREES}",
        1 / (2 * np.pi): "`cam_angle_rad` looks like turns; multiply it by 2 pi or "
        "name the column `{}_turns`",
        1e-3: "`time_s` looks like milliseconds; divide it by 1000 or name the column "
        "`time_ms`",
    }
    for factor, sentence in looks.items():
        near = (abs(one / factor - 1) < _SPEED_TOLERANCE for one in (ratio, typical))
        if any(near):
            hint = sentence.format("cam_angle")
            raise RecordingError(f"{recording.name}: {hint}.")
    rpm = 30 / np.pi
    raise RecordingError(
        f"{recording.name}: the cam turns at {abs(speed) * rpm:.1f} rpm, but the file "
        f"name gives {nominal * rpm:.1f} rpm; correct the name or the column "
        f"`cam_angle_rad`."
    )
