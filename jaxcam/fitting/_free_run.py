"""A model simulated from its inputs alone, against a recording that it did not see."""

import dataclasses
import math
from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..recordings import Recording, RecordingError, Segments
from .engine import (
    augmented_field,
    filtered_channels,
    Input,
    Model,
    runge_kutta,
    state_size,
    Turning,
    with_constants,
)


# Steps of Newton's method on the initial state, and its relative tolerance
_NEWTON, _STILL = 20, 1e-12
# Steps between two samples: while the initial state is sought, and at most
_FIRST_STEPS, _MOST_STEPS = 4, 64
# Change of the simulated motion, in standard deviations of the noise or relative to
# the motion, that halving the steps may make
_OF_NOISE, _OF_MOTION = 0.1, 1e-6
# Steps between two samples may differ by this part
_UNEVEN = 0.01


@dataclasses.dataclass(frozen=True)
class FreeRun:
    """A recording and what a model makes of its inputs alone.

    - `time` (s), `measured` and `simulated` channels, each `(k,)`.
    - `samples`: how many samples the initial `state` was found from; they do not count.
    - `rmse`: of each channel, in its unit.
    """

    record: str
    time: Float[np.ndarray, " k"]
    measured: Mapping[str, Float[np.ndarray, " k"]]
    simulated: Mapping[str, Float[np.ndarray, " k"]]
    state: Float[np.ndarray, " n"]
    samples: int

    @property
    def rmse(self) -> dict[str, float]:
        """Root of the mean squared difference of each channel, in its unit."""
        return {
            name: float(np.sqrt(np.nanmean(self.residual(name)[self.samples :] ** 2)))
            for name in self.simulated
        }

    def residual(self, channel: str) -> Float[np.ndarray, " k"]:
        """Measured less simulated samples."""
        return self.measured[channel] - self.simulated[channel]


def free_run(
    model: Model, recording: Recording | Segments, *, samples: int = 20
) -> FreeRun:
    """Simulate a whole recording from its first samples and its input.

    The state at the first sample is the one whose motion fits the first `samples` best.
    From there on nothing but the measured input is used, held between samples, so that
    errors add up over the whole recording. This is how benchmarks of identification
    judge a model; a fit judges it piece by piece.

    **Arguments:**

    - `model`: a system with its sensors and its input, such as `found.model()`.
    - `recording`: evenly sampled; its `constants` are those of the system.
    - `samples`: how many samples the initial state is found from.

    **Raises:** `RecordingError` for a recording that is too short, unevenly sampled or
    lacks a channel; `ValueError` for a model with a turning drive, and for a motion
    that meets a constraint or does not stay finite.
    """
    run = recording.recording if isinstance(recording, Segments) else recording
    if isinstance(model.drive, Turning):
        raise ValueError(
            "A free run follows a measured input; of a system with a turning drive, "
            "compare flights with `jaxcam.recordings.compare`."
        )
    model = with_constants(model, run)
    level = _levels(model, run)
    data = np.stack([run[name] for name in model.sensors], axis=-1)
    if not 2 <= samples < len(run):
        raise RecordingError(
            f"{run.name}: {samples} samples to begin with are not between 2 and the "
            f"{len(run)} of the recording."
        )
    noise = jnp.stack([sensor.floor for sensor in model.sensors.values()])
    clock = float(run.time[0]), float(run.time[-1] - run.time[0]) / (len(run) - 1)
    state = _initial(model, clock, level[:samples], data[:samples], noise)
    count, found = 1, _simulated(model, state, *clock, level, 1)
    while count < _MOST_STEPS:
        finer = _simulated(model, state, *clock, level, 2 * count)
        off = jnp.max(jnp.abs(finer.channels - found.channels), axis=0)
        size = jnp.ptp(finer.channels, axis=0)
        count, found = 2 * count, finer
        if bool(jnp.all(off <= jnp.maximum(_OF_NOISE * noise, _OF_MOTION * size))):
            break
    channels = np.asarray(found.channels)
    if not np.all(np.isfinite(channels)):
        raise ValueError(
            f"{run.name}: the free run does not stay finite; check the signs of the "
            f"model's damping and stiffness."
        )
    below = np.flatnonzero(np.asarray(found.gap) < 0)
    if len(below):
        raise ValueError(
            f"{run.name}: the free run meets a constraint at "
            f"{run.time[below[0]]:.4g} s; it serves motions without impacts, use "
            f"`jaxcam.simulate` for others."
        )
    names = tuple(model.sensors)
    return FreeRun(
        run.name,
        run.time,
        {name: data[:, k] for k, name in enumerate(names)},
        {name: channels[:, k] for k, name in enumerate(names)},
        np.asarray(state),
        samples,
    )


class _Simulated(NamedTuple):
    """Channels `(k, c)` and the least gap `(k,)` at each sample."""

    channels: Float[jax.Array, "k c"]
    gap: Float[jax.Array, " k"]


@eqx.filter_jit
def _simulated(model: Model, state, start, interval, level, count: int) -> _Simulated:
    """The motion at each sample, by `count` steps between two of them."""
    step = interval / count
    size = state.shape[0] - len(filtered_channels(model))

    def seen(t, system, x):
        field = augmented_field(model, system, t, x)
        values = []
        for name, sensor in model.sensors.items():
            if sensor.filtered:
                place = size + filtered_channels(model).index(name)
                value, slope = x[place], field[place]
            else:
                value, slope = jax.jvp(sensor.seen, (x[:size],), (field[:size],))
            values.append(sensor.offset + sensor.gain * (value - sensor.lag * slope))
        gap = jnp.min(jnp.atleast_1d(system.gap(t, x[:size])))
        return _Simulated(jnp.stack(values), gap)

    def sample(x, inputs):
        number, value = inputs
        t = start + number * interval
        system = model.driven(t, value, jnp.zeros_like(t))

        def advance(k, x):
            return runge_kutta(model, system, t + k * step, x, step)[0]

        after = jax.lax.fori_loop(0, count, advance, x)
        return after, seen(t, system, x)

    numbers = jnp.arange(level.shape[0], dtype=float)
    return jax.lax.scan(sample, state, (numbers, level))[1]


def _initial(model: Model, clock, level, data, noise):
    """The state whose motion fits the first samples best, by Gauss-Newton."""

    @eqx.filter_jit
    def off(state):
        found = _simulated(model, state, *clock, level, _FIRST_STEPS).channels
        missed = jnp.where(jnp.isfinite(data), (data - found) / noise, 0.0)
        return jnp.ravel(missed)

    size = state_size(model) + len(filtered_channels(model))
    state = jnp.zeros(size)
    for sensor in model.sensors.values():
        if isinstance(sensor.observe, int):
            pick = list(model.sensors.values()).index(sensor)
            first = data[np.flatnonzero(np.isfinite(data[:, pick]))[0], pick]
            value = (first - sensor.offset) / sensor.gain
            state = state.at[sensor.observe].set(value)
    slope = eqx.filter_jit(jax.jacfwd(off))
    cost = math.inf
    for _ in range(_NEWTON):
        rows, missed = np.asarray(slope(state)), np.asarray(off(state))
        now = float(missed @ missed)
        if not now < cost * (1 - _STILL):
            break
        cost = now
        # rows in like units: a state that no sample shows does not move
        scale = np.linalg.norm(rows, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        state = state - np.linalg.lstsq(rows / scale, missed, rcond=None)[0] / scale
    return state


def _levels(model: Model, run: Recording):
    """The input at each sample; zero without one."""
    spacing = np.diff(run.time)
    if np.ptp(spacing) > 2 * _UNEVEN * np.mean(spacing):
        raise RecordingError(
            f"{run.name}: its samples are not evenly spaced; resample it first."
        )
    if not isinstance(model.drive, Input):
        return jnp.zeros(len(run))
    return jnp.asarray(run[model.drive.channel])

