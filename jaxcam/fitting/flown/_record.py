"""The samples of one recording, and its drive, as arrays for flights of a model."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ...recordings import Recording
from ...recordings.against_model import state_at
from ...recordings.cut import Drive, padded, saturated
from ..engine import DriveState, Input, measured_components, Model, state_size


# Integration steps per oscillation: the classical Runge-Kutta method then follows a
# period to a hundred-thousandth of its amplitude
_STEPS = 40
_MOST_SUBSTEPS = 8


class Record(eqx.Module):
    """Samples `(k, c)` of the channels that show a component of the state, unfiltered.

    The arrays are padded, so that recordings of similar lengths share a program.
    `drive` holds the motion of the drive, or mean and slope of the input, in the step
    after each sample. `guess` is the state estimated from the samples around each of
    them, `(k, n)`.
    """

    begin: Float[Array, ""]
    interval: Float[Array, ""]
    values: Float[Array, "k c"]
    known: Bool[Array, "k c"]
    noise: Float[Array, " c"]
    guess: Float[Array, "k n"]
    drive: DriveState
    channels: tuple[str, ...] = eqx.field(static=True)
    substeps: int = eqx.field(static=True)
    lagged: bool = eqx.field(static=True)


def record_of(
    model: Model, recording: Recording, drive: Drive | None, period: float
) -> Record:
    """Return the arrays of a recording.

    **Arguments:** the `drive` of the recording, if it has an encoder; the `period` of
    its oscillation (s).
    """
    sensors = model.sensors
    components = measured_components(model)
    names = tuple(components)
    time, interval = recording.time, recording.interval
    columns = np.stack([recording[name] for name in names], axis=-1)
    hidden = [saturated(recording[name]) for name in names]
    known = np.isfinite(columns) & ~np.stack(hidden, axis=-1)
    columns = np.where(known, columns, 0.0)
    picks = list(components.values())
    gains = np.array([float(sensors[name].gain) for name in names])
    offsets = np.array([float(sensors[name].offset) for name in names])
    seen = (columns - offsets) / gains
    rates = np.gradient(seen, interval, axis=0)
    system = model.system if drive is None else model.uniform(drive.phase, drive.speed)
    guess = state_at(system, picks, time, seen, rates, state_size(model))
    substeps = int(np.clip(np.ceil(_STEPS * interval / period), 1, _MOST_SUBSTEPS))
    arrays = (columns, known, guess, *_drive(model, recording, drive))
    columns, known, guess, *moving = (jnp.asarray(padded(one)) for one in arrays)
    return Record(
        jnp.asarray(float(time[0])),
        jnp.asarray(interval),
        columns,
        known,
        jnp.asarray([float(sensors[name].floor) for name in names]),
        guess,
        DriveState(*moving),
        names,
        substeps,
        any(float(sensors[name].remaining_lag) != 0 for name in names),
    )


def _drive(
    model: Model, recording: Recording, drive: Drive | None
) -> Sequence[np.ndarray]:
    """Return angle, rate and acceleration of the drive in the step after each sample,
    or mean and slope of the input.
    """
    none = np.zeros(len(recording))
    if isinstance(model.drive, Input):
        level = recording[model.drive.channel]
        slope = model.drive.slopes(recording.time, level)
        return level + slope * recording.interval / 2, slope, none
    if drive is None:
        return none, none + 1.0, none
    columns = drive.angle, drive.rate, drive.acceleration.values
    return [np.append((one[1:] + one[:-1]) / 2, one[-1]) for one in columns]


def readings_of(model: Model, record: Record, state, rate) -> Float[Array, " c"]:
    """Return the readings of the channels for a state and its rate of change."""
    found, components = [], measured_components(model)
    for name in record.channels:
        sensor, place = model.sensors[name], components[name]
        value = state[place]
        if record.lagged:
            value = value - sensor.remaining_lag * rate[place]
        found.append(sensor.offset + sensor.gain * value)
    return jnp.stack(found)
