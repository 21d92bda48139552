"""The motion of a free run: its initial state, its steps and its samples."""

import dataclasses
import math
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..hybrid import SwitchedSystem
from ..hybrid.programs import program
from ..hybrid.surface import gaps
from ..recordings import Recording, RecordingError, Segments
from .engine import (
    augmented_field,
    discrete_state_of,
    DriveState,
    filtered_channels,
    first_mode,
    Input,
    JUMP,
    Model,
    number_of_discrete_states,
    runge_kutta,
    state_size,
    surfaces_in,
    switched_steps,
    Turning,
    with_constants,
)


# Maximum number of Gauss-Newton steps for the initial state, and the relative decrease
# of the cost below which the iteration ends
_NEWTON, _STILL = 20, 1e-12
# Relative regularisation: it keeps an unobserved component of the initial state
_LEAST = 1e-12
# Integration steps between two samples: initial and maximum number
_FIRST_STEPS, _MOST_STEPS = 2, 64
# Allowed change when the steps are halved: standard deviations, or relative to motion
_OF_NOISE, _OF_MOTION = 0.1, 1e-6
# Change, relative to the motion, above which the largest number of steps is too small
_TOO_FAR = 1e-2
EVENTS = 4
"""Maximum number of switching events located between two samples; if this number is
reached, there may be more."""
# Relative difference allowed between sampling intervals
_UNEVEN = 0.01


class Prepared(eqx.Module):
    """A recording prepared for a free run.

    `state` `(n,)` is the state at the first sample, estimated from the first `samples`;
    `start` and `interval` (s) are the time of that sample and the sampling interval;
    `drive` is the input at each sample, with its slope, `(k,)`; `data` `(k, c)` are the
    samples, `noise` `(c,)` their noise; `steps` are the integration steps per sample;
    `discrete` is the discrete state at the first sample, `None` if there is only one.
    """

    state: Float[Array, " n"]
    start: Float[Array, ""]
    interval: Float[Array, ""]
    drive: DriveState
    data: Float[Array, "k c"]
    noise: Float[Array, " c"]
    samples: int = eqx.field(static=True)
    steps: int = eqx.field(static=True)
    discrete: Int[Array, ""] | None = None


class Simulated(NamedTuple):
    """Channels `(k, c)` and the smallest gap `(k,)` at each sample, and the number of
    events `(k,)` up to the next sample.
    """

    channels: Float[Array, "k c"]
    gap: Float[Array, " k"]
    events: Int[Array, " k"]


def prepared(model: Model, recording: Recording | Segments, samples: int) -> Prepared:
    """Return a recording prepared for a free run: initial state and enough steps.

    **Raises:** see `free_run`.
    """
    run = recording.recording if isinstance(recording, Segments) else recording
    if isinstance(model.drive, Turning):
        raise ValueError(
            "A free run follows a measured input; for a system with a rotating drive, "
            "compare flights with `jaxcam.recordings.compare`."
        )
    model = with_constants(model, run)
    drive = _drive(model, run)
    data = np.stack([run[name] for name in model.sensors], axis=-1)
    if not 2 <= samples < len(run):
        raise RecordingError(
            f"{run.name}: `samples` is {samples}; give a number between 2 and "
            f"{len(run)}, the number of samples in the recording."
        )
    interval = (run.time[-1] - run.time[0]) / (len(run) - 1)
    one = Prepared(
        _first_state(model, data),
        jnp.asarray(float(run.time[0])),
        jnp.asarray(float(interval)),
        drive,
        jnp.asarray(data, dtype=float),
        jnp.stack([sensor.floor for sensor in model.sensors.values()]),
        samples,
        _FIRST_STEPS,
    )
    one = _in_likely_state(model, one)
    found = simulated(model, one)
    while True:
        # if the steps are too long, the estimated initial state may also be far off
        finer = _started(model, dataclasses.replace(one, steps=2 * one.steps))
        again = simulated(model, finer)
        off = jnp.max(jnp.abs(again.channels - found.channels), axis=0)
        size = jnp.ptp(again.channels, axis=0)
        if bool(jnp.all(off <= jnp.maximum(_OF_NOISE * one.noise, _OF_MOTION * size))):
            return one
        one, found = finer, again
        if one.steps >= _MOST_STEPS:
            break
    if bool(jnp.any(off > jnp.maximum(one.noise, _TOO_FAR * size))):
        raise ValueError(
            f"{run.name}: {_MOST_STEPS} integration steps between two samples are too "
            f"few; give a recording with shorter sampling intervals."
        )
    return one


@program
def simulated(model: Model, one: Prepared) -> Simulated:
    """Simulate the motion from the initial state, and evaluate it at each sample."""
    step = one.interval / one.steps
    size = one.state.shape[0] - len(filtered_channels(model))

    def seen(t, system, x, field, events: Any = 0):
        values, along = [], (jnp.ones_like(t), field[:size])
        for name, sensor in model.sensors.items():
            if sensor.filtered:
                place = size + filtered_channels(model).index(name)
                value, slope = x[place], field[place]
            else:
                read = partial(sensor.seen, system)
                value, slope = jax.jvp(read, (t, x[:size]), along)
            value = value - sensor.remaining_lag * slope
            values.append(sensor.offset + sensor.gain * value)
        gap = jnp.min(gaps(system, t, x[:size]), initial=jnp.inf)
        return Simulated(jnp.stack(values), gap, jnp.asarray(events, dtype=int))

    def sample(carried, inputs):
        x, mode = carried
        number, drive = inputs
        t = one.start + number * one.interval
        system = model.driven(t, drive)
        if mode is not None:
            middle = step * (jnp.arange(one.steps, dtype=float) + 0.5)
            each = DriveState(*(part + 0.0 * middle for part in drive))
            each = each._replace(angle=drive.angle + drive.rate * middle)
            given = model, x, t, step, each, mode, EVENTS
            end, rate, found = switched_steps(*given)
            return (end, found.mode), seen(t, system, x, rate, found.events)

        def advance(x, k):
            at = t + k * step
            return runge_kutta(model, model.during(t, drive), at, x, step)[0], None

        after, _ = jax.lax.scan(advance, x, jnp.arange(one.steps, dtype=float))
        field = augmented_field(model, system, t, x)
        return (after, None), seen(t, system, x, field)

    numbers, mode = jnp.arange(one.data.shape[0], dtype=float), None
    if isinstance(model.system, SwitchedSystem):
        first = DriveState(*(part[0] for part in one.drive))
        system = model.driven(one.start, first)
        known = surfaces_in(system, one.start, one.state[:size])
        given = one.start, one.state[:size], one.interval, one.discrete
        mode = first_mode(known, system, *given)
    return jax.lax.scan(sample, (one.state, mode), (numbers, one.drive))[1]


def _first_state(model: Model, data) -> Float[Array, " n"]:
    """Return a state with positions from the first samples and zero velocities."""
    state = jnp.zeros(state_size(model) + len(filtered_channels(model)))
    for k, sensor in enumerate(model.sensors.values()):
        seen = np.flatnonzero(np.isfinite(data[:, k]))
        if isinstance(sensor.observe, int) and len(seen):
            value = (data[seen[0], k] - sensor.offset) / sensor.gain
            state = state.at[sensor.observe].set(value)
    return state


def _in_likely_state(model: Model, one: Prepared) -> Prepared:
    """Return the recording with its initial state fitted to the first samples, in the
    most likely discrete state: that in which the system starts, unless the samples
    contradict it.
    """
    size = one.state.shape[0] - len(filtered_channels(model))
    count = number_of_discrete_states(model, size)
    if count == 1:
        return _started(model, one)
    best, least = one, math.inf
    for number in range(count):
        discrete = jnp.asarray(number)
        tried = _started(model, dataclasses.replace(one, discrete=discrete))
        missed = np.asarray(_off(model, _first(tried), tried.state)[0])
        other = number != int(_stated(model, tried))
        cost = float(missed @ missed) + (JUMP if other else 0.0)
        if cost < least:
            best, least = tried, cost
    return best


def _stated(model: Model, one: Prepared) -> Int[Array, ""]:
    """Return the discrete state in which the system starts at the first sample."""
    system = model.driven(one.start, DriveState(*(part[0] for part in one.drive)))
    assert isinstance(system, SwitchedSystem)
    x = one.state[: one.state.shape[0] - len(filtered_channels(model))]
    known = surfaces_in(system, one.start, x)
    return discrete_state_of(known, system.sides(one.start, x) < 0)


def _started(model: Model, one: Prepared) -> Prepared:
    """Fit the initial state to the first samples by Gauss-Newton."""
    few = _first(one)
    state, cost = np.asarray(one.state), math.inf
    for _ in range(_NEWTON):
        missed, rows = (np.asarray(x) for x in _off(model, few, jnp.asarray(state)))
        now = float(missed @ missed)
        if not now < cost * (1 - _STILL):
            break
        cost = now
        # columns of unit length; an unobserved component is not changed
        scale = np.linalg.norm(rows, axis=0)
        scale[scale == 0] = 1.0
        state = state - np.linalg.lstsq(rows / scale, missed, rcond=None)[0] / scale
    return dataclasses.replace(one, state=jnp.asarray(state))


@program
def _off(model: Model, one: Prepared, state):
    """Return the residuals in units of the noise, and their derivatives with respect to
    the initial state.
    """

    def missed(state):
        found = simulated(model, dataclasses.replace(one, state=state)).channels
        off = (found - one.data) / one.noise[None]
        return jnp.ravel(jnp.where(jnp.isfinite(one.data), off, 0.0))

    return missed(state), jax.jacfwd(missed)(state)


def restarted(model: Model, one: Prepared) -> Prepared:
    """Return the recording with its state adapted to another model, to first order.

    The result is differentiable, so that a fit includes the dependence of the initial
    state on the parameters.
    """
    few = _first(one)
    missed, rows = _off(model, few, few.state)
    # the scales only improve the conditioning, so they are not differentiated
    scale = jnp.linalg.norm(jax.lax.stop_gradient(rows), axis=0)
    scale = jnp.where(scale > 0, scale, 1.0)
    rows = rows / scale[None]
    inside = rows.T @ rows + _LEAST * jnp.eye(len(scale))
    step = jnp.linalg.solve(inside, rows.T @ missed) / scale
    return dataclasses.replace(one, state=one.state - step)


def _first(one: Prepared) -> Prepared:
    """Return the part of the recording to which the initial state is fitted."""
    drive = DriveState(*(part[: one.samples] for part in one.drive))
    return dataclasses.replace(one, drive=drive, data=one.data[: one.samples])


def _drive(model: Model, run: Recording) -> DriveState:
    """Return the input at each sample, if any, and its slope after it."""
    spacing = np.diff(run.time)
    if np.ptp(spacing) > 2 * _UNEVEN * np.mean(spacing):
        raise RecordingError(
            f"{run.name}: its samples are not evenly spaced; resample it first."
        )
    level, slope, none = np.zeros((3, len(run)))
    if isinstance(model.drive, Input):
        level = run[model.drive.channel]
        slope = model.drive.slopes(run.time, level)
    return DriveState(*map(jnp.asarray, (level, slope, none)))
