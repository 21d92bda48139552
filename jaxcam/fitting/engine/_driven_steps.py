"""The measured drive or input of recordings, at given times and in steps."""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float
from scipy.signal import savgol_coeffs

from ...recordings import Segments
from ...recordings.cut import Drive
from ._model import DriveState, Input, Numbers


# Times at which the steps of each piece of each recording begin and end
Edges: TypeAlias = Float[np.ndarray, "r k n1"]


def drive_at(segments: Sequence[Segments], times) -> DriveState:
    """Return the motion of each recording's drive at `times`, in the same shape."""
    angle, rate = np.zeros(times.shape), np.ones(times.shape)
    acceleration = np.zeros(times.shape)
    for row, part in enumerate(segments):
        if part.drive is not None:
            time, at = part.recording.time, times[row]
            angle[row] = np.interp(at, time, part.drive.angle)
            rate[row] = np.interp(at, time, part.drive.rate)
            acceleration[row] = np.interp(at, time, part.drive.acceleration.values)
    return DriveState(angle, rate, acceleration)


def mean_rates(segments: Sequence[Segments], edges: Edges):
    """Return the mean rate of each recording's drive in every step, `(r, k, n)`.

    The noise of the mean cancels between neighbouring steps, unlike that of a sample.
    """
    step = np.diff(edges)
    mean = np.ones(step.shape)
    for row, part in enumerate(segments):
        if part.drive is not None:
            time = part.recording.time
            middle = (part.drive.rate[1:] + part.drive.rate[:-1]) / 2
            turned = np.concatenate([[0.0], np.cumsum(middle * np.diff(time))])
            mean[row] = np.diff(np.interp(edges[row], time, turned)) / step[row]
    return mean


def input_at(segments: Sequence[Segments], source: Input, times) -> DriveState:
    """Return the input of each recording at `times`, in the same shape."""
    found = np.zeros(times.shape)
    for row, part in enumerate(segments):
        time, level = part.recording.time, part.recording[source.channel]
        last = np.searchsorted(time, times[row], side="right") - 1
        last = np.maximum(last, 0)
        slope = source.slopes(time, level)[last]
        found[row] = level[last] + slope * np.maximum(times[row] - time[last], 0.0)
    return DriveState(found, np.zeros(times.shape), np.zeros(times.shape))


def input_in_steps(
    segments: Sequence[Segments], source: Input, edges: Edges
) -> DriveState:
    """Return the mean and the slope of each recording's input in every step, `(r, k,
    n)`.

    A linear input with this mean and slope has the same integral and first moment as
    the input; otherwise, a jump within a step would cause an error of position.
    """
    step = np.diff(edges)
    mean, slope = np.zeros(step.shape), np.zeros(step.shape)
    for row, part in enumerate(segments):
        time, level = part.recording.time, part.recording[source.channel]
        slopes = source.slopes(time, level)
        first, second = _integrals(time, level, slopes, edges[row])
        h = step[row]
        mean[row] = np.diff(first) / h
        # the moment about the middle of a step, integrated by parts
        moment = h / 2 * (first[:, 1:] + first[:, :-1]) - np.diff(second)
        slope[row] = 12 * moment / h**3
    return DriveState(mean, slope, np.zeros(step.shape))


def lines_in_parts(lines: DriveState, step, parts: int) -> DriveState:
    """Return the lines that represent an input in each step, in equal parts of the
    steps.

    **Arguments:** the lines, `(r, k, n)` each; the length of the steps `(r, k)`; the
    number of `parts`.
    """
    middle = (np.arange(parts) + 0.5) / parts - 0.5
    along = np.asarray(step)[..., None, None] * middle
    mean, slope = (np.asarray(one)[..., None] for one in (lines.angle, lines.rate))
    found = np.broadcast_arrays(mean + slope * along, slope, 0.0)
    return DriveState(*(one.reshape(*one.shape[:-2], -1) for one in found))


def _integrals(time, level, slope, at):
    """Return the first and second integrals, at the given times, of an input with a
    level at each sample and a slope after it.
    """
    interval = np.diff(time)
    once = level[:-1] * interval + slope[:-1] * interval**2 / 2
    twice = level[:-1] * interval**2 / 2 + slope[:-1] * interval**3 / 6
    first = np.concatenate([[0.0], np.cumsum(once)])
    grown = first[:-1] * interval + twice
    second = np.concatenate([[0.0], np.cumsum(grown)])
    last = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    after = np.clip(at - time[last], 0.0, interval[last])
    once = level[last] * after + slope[last] * after**2 / 2
    twice = level[last] * after**2 / 2 + slope[last] * after**3 / 6
    return first[last] + once, second[last] + first[last] * after + twice


class DriveError(NamedTuple):
    """Standard errors of each recording's drive, `(r,)`.

    A system without a field for the acceleration is driven at a uniform rate. For a
    base that moves with the drive, the forces due to an acceleration are as large as
    those due to an error of `acceleration / (2 rate)` in the rate. These forces act for
    as long as the rate changes, which is longer than a piece, so they are nearly the
    same in several consecutive pieces. Since a fit treats the errors of the pieces as
    independent, the last two errors are enlarged accordingly.
    """

    angle: Numbers
    """Standard error of the smoothed angle (rad)."""
    rate: Numbers
    """Standard error of the smoothed rate (rad/s)."""
    turned: Numbers
    """Standard error of the integral of the smoothed rate (rad)."""
    mean: Numbers
    """Standard error of the mean angle over one second (rad)."""
    unsteadiness: Numbers
    """Standard error of the rate (rad/s), if the acceleration is neglected."""
    acceleration: Numbers
    """Standard error of the acceleration (rad/s^2)."""


def drive_error(segments: Sequence[Segments], steps: int) -> DriveError:
    """Return the errors of the drives, for pieces of `steps` samples."""
    rows = [_errors(part, steps * part.recording.interval) for part in segments]
    return DriveError(*np.array(rows).T)


def _errors(part: Segments, length: float) -> tuple[float, ...]:
    """Return the errors of one drive, for pieces of the given `length` (s)."""
    if part.drive is None:
        return (0.0,) * len(DriveError._fields)
    interval = part.recording.interval
    count = part.drive.window
    smooth = savgol_coeffs(count, 2)
    slope = savgol_coeffs(count, 2, deriv=1, delta=interval)
    weights = smooth, slope, np.cumsum(slope) * interval
    angle, rate, turned = (part.drive.noise * float(np.linalg.norm(w)) for w in weights)
    mean = part.drive.noise * float(np.sqrt(interval))
    slow = part.drive.acceleration
    error = slow.stderr * float(np.sqrt(max(1.0, slow.length / length)))
    return angle, rate, turned, mean, _unsteadiness(part.drive, length), error


def _unsteadiness(drive: Drive, length: float) -> float:
    """Return the error of the rate (rad/s) by which a fit represents neglected changes
    of the rate.
    """
    slow = drive.acceleration
    square = float(np.mean(slow.values**2)) - 2 * slow.stderr**2
    # twice the noise is subtracted, because the mean square of a few independent values
    # may exceed its expectation by about as much as the expectation itself
    if square <= 0:
        return 0.0
    acceleration = np.sqrt(square)
    lasts = np.std(drive.rate) / acceleration
    shares = np.sqrt(max(1.0, lasts / length))
    return float(acceleration / (2 * abs(drive.speed)) * shares)
