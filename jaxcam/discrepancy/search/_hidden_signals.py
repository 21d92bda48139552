"""Signals of hidden elements driven by a measured position, for each recording."""

import dataclasses
import math
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.signal import lfilter, savgol_filter

from ...fitting import Problem


# Window (samples) of the quadratic polynomials that smooth a flight. The smoothing
# causes no delay, and it suppresses only frequencies far above those that the
# integration steps resolve
_WINDOW = 9
# Recordings are padded to a multiple of this number of samples, so that recordings of
# similar length share a compiled program
_STRIDE = 2048


@dataclasses.dataclass(frozen=True)
class Driven:
    """The measured position of each recording at equidistant times.

    `position` `(r, n)`: positions, padded with the last value of each recording;
    `begin`, `interval` `(r,)`: start and step of the times; `spread`: largest distance
    of the positions from their `middle`; `motion_unit`: unit of the position.
    """

    position: Float[np.ndarray, "r n"]
    begin: Float[np.ndarray, " r"]
    interval: Float[np.ndarray, " r"]
    middle: float
    spread: float
    motion_unit: str = ""


def driven_by(problem: Problem, motion_unit: str = "") -> Driven | None:
    """Return the measured position of the first coordinate, smoothed in each flight, or
    `None` if no sensor measures it.
    """
    place = problem.model.system.coordinates[0][0]  # pyright: ignore
    channels = [n for n, s in problem.model.sensors.items() if s.observe == place]
    if not channels:
        return None
    rows = [_smooth(part, channels[0]) for part in problem.segments]
    longest = max(len(row) for row in rows)
    size = _STRIDE * -(-longest // _STRIDE)
    position = np.stack([np.pad(row, (0, size - len(row)), "edge") for row in rows])
    every = np.concatenate(rows)
    low, high = float(every.min()), float(every.max())
    return Driven(
        position,
        np.array([float(part.recording.time[0]) for part in problem.segments]),
        np.array([part.recording.interval for part in problem.segments]),
        (low + high) / 2,
        (high - low) / 2,
        motion_unit,
    )


def _smooth(part, channel: str) -> Float[np.ndarray, " n"]:
    """Return a channel of one recording at equidistant times, smoothed in each flight
    by local polynomials, none of which extends across an impact.
    """
    record = part.recording
    time, interval = record.time, record.interval
    values = np.asarray(record[channel], dtype=float)
    fine = np.isfinite(values)
    count = round((time[-1] - time[0]) / interval) + 1
    at = time[0] + interval * np.arange(count)
    found = np.interp(at, time[fine], values[fine])
    smooth = found.copy()
    for flight in part.flights:
        inside = (at > flight.start.time) & (at < flight.stop.time)
        rows = np.flatnonzero(inside)
        if len(rows) >= _WINDOW:
            smooth[rows] = savgol_filter(found[rows], _WINDOW, 2)
    return smooth


def resonance_signals(driven: Driven, frequency: float, ratio: float):
    """Return the outputs z, z' of `z'' + 2 D w z' + w^2 z = q`, and two independent
    free responses.

    Here, q is the measured position, w the angular frequency and D the damping `ratio`.
    The outputs are exact for a position that is linear between samples; the element
    starts at rest.

    **Returns:** two arrays `(r, n, 2)`.
    """
    w = 2 * math.pi * frequency
    root = math.sqrt(1 - ratio**2)
    pole = complex(-ratio * w, w * root)
    filtered, free = [], []
    for position, interval in zip(driven.position, driven.interval):
        y = _first_order(position, pole, interval)
        # up to a factor, z and z' are the imaginary parts of y and of `pole * y`
        filtered.append(np.stack([y.imag, (pole * y).imag], axis=-1) / (w * root))
        wave = np.exp(pole * interval * np.arange(len(position)))
        free.append(np.stack([wave.real, wave.imag], axis=-1))
    return np.array(filtered), np.array(free)


def relaxation_signals(driven: Driven, time: float):
    """Return the output and the free response of `z' = v - z / time`, where v is the
    measured velocity, both `(r, n, 1)`.
    """
    pole = complex(-1 / time)
    filtered, free = [], []
    for position, interval in zip(driven.position, driven.interval):
        y = _first_order(position, pole, interval).real
        filtered.append((position - y / time)[:, None])
        free.append(np.exp(pole.real * interval * np.arange(len(position)))[:, None])
    return np.array(filtered), np.array(free)


def _first_order(position, pole: complex, interval: float):
    """Solve `y' = pole y + q`, where q is the position, starting from rest."""
    x = pole * interval
    end = np.exp(x)
    last = (end - 1 - x) / (x * pole)
    first = (end - 1) / pole - last
    start = -position[0] / pole
    found, _ = lfilter(
        [last, first], [1.0, -end], position, zi=[start - last * position[0]]
    )
    return found


# Initial state of a hysteretic element, as a fraction of its scale, used to compute the
# effect of a change in the initial state
_BESIDE = 1e-3
# Limit on the state of a stiffening hysteretic element, in units of its scale: without
# a limit, the state may become infinite at a finite deflection
_MOST = 30.0


def hysteresis_signals(
    driven: Driven, limits: Any, betas: Any, powers: Any, loading: int = 1
) -> tuple[Float[np.ndarray, "k r n 1"], Float[np.ndarray, "k r n 1"]]:
    """Compute Bouc-Wen hysteresis for `k` sets of parameters at once.

    **Returns:** the internal state, starting from zero, and its derivative with respect
    to the initial state.
    """
    limits, betas, powers = (
        np.asarray(x, dtype=float)[:, None] for x in (limits, betas, powers)
    )
    most = limits if loading > 0 else _MOST * limits
    steps = np.diff(driven.position, axis=1)

    def slope(z, sign):
        size = np.maximum(np.abs(z) / limits, 1e-12)
        turned = betas * np.sign(z) * sign + 1 - betas
        return 1 - loading * turned * size**powers

    def run(start):
        z = np.broadcast_to(start, (len(limits), len(steps))).astype(float)
        found = np.empty((steps.shape[1] + 1, *z.shape))
        found[0] = z
        for k in range(steps.shape[1]):
            step = steps[:, k]
            sign = np.sign(step)
            middle = z + step / 2 * slope(z, sign)
            z = z + step * slope(middle, sign)
            z = np.clip(z, -most, most)
            found[k + 1] = z
        return np.moveaxis(found, 0, -1)[..., None]

    state = run(np.zeros((1, 1)))
    beside = run(_BESIDE * limits)
    return state, (beside - state) / (_BESIDE * limits[..., None, None])


def at_times(
    driven: Driven, signals: Float[np.ndarray, "r n s"], time
) -> Float[np.ndarray, "r k l s"]:
    """Interpolate signals linearly at the given times `(r, k, l)`."""
    found = []
    for signal, at, begin, interval in zip(
        signals, time, driven.begin, driven.interval
    ):
        place = np.clip((at - begin) / interval, 0, len(signal) - 1.001)
        first = place.astype(int)
        u = (place - first)[..., None]
        found.append((1 - u) * signal[first] + u * signal[first + 1])
    return np.array(found)
