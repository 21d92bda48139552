"""The measured drive or input of recordings, at given times and in steps."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Float
from scipy.signal import savgol_coeffs, savgol_filter

from ...recordings import Segments


# Length of the window that shows changes of the rate, over that which smooths it
_STEADY = 10
# Ends of the steps of each piece of each recording
Edges: TypeAlias = Float[np.ndarray, "r k n1"]


def drive_at(segments: Sequence[Segments], times):
    """Return the angle and rate of each recording's drive, in the shape of `times`."""
    angle, rate = np.zeros(times.shape), np.ones(times.shape)
    for row, part in enumerate(segments):
        if part.drive is not None:
            time, at = part.recording.time, times[row]
            angle[row] = np.interp(at, time, part.drive.angle)
            rate[row] = np.interp(at, time, part.drive.rate)
    return angle, rate


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


def input_at(segments: Sequence[Segments], channel: str, times):
    """Return the input of each recording, held since the last sample, in the shape of
    `times`.
    """
    found = np.zeros(times.shape)
    for row, part in enumerate(segments):
        time = part.recording.time
        last = np.searchsorted(time, times[row], side="right") - 1
        found[row] = part.recording[channel][np.maximum(last, 0)]
    return found


def input_in_steps(segments: Sequence[Segments], channel: str, edges: Edges):
    """Return the mean and the slope of each recording's input in every step, `(r, k,
    n)`.

    A linear input with them has the integral and the first moment of the held samples:
    a step that contains a jump would otherwise leave an error of position.
    """
    step = np.diff(edges)
    mean, slope = np.zeros(step.shape), np.zeros(step.shape)
    for row, part in enumerate(segments):
        time, level = part.recording.time, part.recording[channel]
        first, second = _integrals(time, level, edges[row])
        h = step[row]
        mean[row] = np.diff(first) / h
        # by parts: the moment about the middle of a step
        moment = h / 2 * (first[:, 1:] + first[:, :-1]) - np.diff(second)
        slope[row] = 12 * moment / h**3
    return mean, slope


def _integrals(time, level, at):
    """Return the first and second integrals of held samples at some times."""
    interval = np.diff(time)
    first = np.concatenate([[0.0], np.cumsum(level[:-1] * interval)])
    grown = first[:-1] * interval + level[:-1] * interval**2 / 2
    second = np.concatenate([[0.0], np.cumsum(grown)])
    last = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    after = np.clip(at - time[last], 0.0, interval[last])
    once = first[last] + level[last] * after
    return once, second[last] + first[last] * after + level[last] * after**2 / 2


def drive_error(
    part: Segments, length: float
) -> tuple[float, float, float, float, float]:
    """Return the standard errors of a drive: of its smoothed angle and rate, of the
    integral of that rate, of the mean angle over one second, and of the rate of uniform
    rotation over a piece of some `length` (s).

    A model of a system is driven at a uniform rate. The forces of an acceleration are
    as large as those of an error `acceleration / (2 rate)` of the rate, for a base that
    moves with the drive; they act over the time in which the rate changes, which is
    longer than a piece.
    """
    if part.drive is None:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    interval = part.recording.interval
    count = part.drive.window
    smooth = savgol_coeffs(count, 2)
    slope = savgol_coeffs(count, 2, deriv=1, delta=interval)
    weights = smooth, slope, np.cumsum(slope) * interval
    angle, rate, turned = (part.drive.noise * float(np.linalg.norm(w)) for w in weights)
    mean = part.drive.noise * float(np.sqrt(interval))
    return angle, rate, turned, mean, _unsteadiness(part, length)


def _unsteadiness(part: Segments, length: float) -> float:
    """Return the error of the rate (rad/s) that stands for its changes."""
    drive, interval = part.drive, part.recording.interval
    assert drive is not None
    count = min(_STEADY * drive.window, len(drive.rate) // 3) // 2 * 2 - 1
    if count < 5:
        return 0.0
    inside = slice(count // 2, -(count // 2))
    slow = np.asarray(savgol_filter(drive.rate, count, 2))[inside]
    change = np.asarray(savgol_filter(drive.rate, count, 2, deriv=1, delta=interval))
    first = savgol_coeffs(drive.window, 2, deriv=1, delta=interval)
    second = savgol_coeffs(count, 2, deriv=1, delta=interval)
    noise = drive.noise * float(np.linalg.norm(np.convolve(first, second)))
    # a few independent values scatter by about as much as their mean
    square = float(np.mean(change[inside] ** 2)) - 2 * noise**2
    if square <= 0:
        return 0.0
    acceleration = np.sqrt(square)
    lasts = np.std(slow) / acceleration
    shares = np.sqrt(max(1.0, lasts / length))
    return float(acceleration / (2 * abs(drive.speed)) * shares)
