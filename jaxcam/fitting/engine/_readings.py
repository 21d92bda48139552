"""Readings of the sensors at both ends of each step of a piece."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._model import augmented_field, DriveState, filtered_channels, Model
from ._output import Output


class Nodes(NamedTuple):
    """Values and rates of the channels at both ends of each step.

    Gain, offset and lag of the sensors are not yet applied.
    """

    left: Float[Array, "n c"]
    right: Float[Array, "n c"]
    left_rate: Float[Array, "n c"]
    right_rate: Float[Array, "n c"]


def readings(model: Model, states, fields, start, step, drive: DriveState) -> Nodes:
    """Return the readings along a piece of flight.

    Args:
        model: The model.
        states: States at the ends of all steps, shape `(n + 1, s)`.
        fields: Their rates of change, shape `(n + 1, s)`.
        start: Time at the beginning of the piece (s).
        step: Length of a step (s).
        drive: Motion of the drive in each step.
    """
    if not any(isinstance(one.observe, Output) for one in model.sensors.values()):
        values, rates = jax.vmap(lambda x, f: _of_state(model, x, f))(states, fields)
        return Nodes(values[:-1], values[1:], rates[:-1], rates[1:])
    numbers = jnp.arange(drive.angle.shape[0], dtype=float)

    def at_both_ends(number, here, before, after):
        # both with the drive or input of this step: the next one may begin with a jump
        # of the force, which an output shows
        t0 = start + number * step
        system_at = model.during(t0 + step / 2, here)
        return _of_motion(model, system_at, t0, before), _of_motion(
            model, system_at, t0 + step, after
        )

    (left, left_rate), (right, right_rate) = jax.vmap(at_both_ends)(
        numbers, drive, states[:-1], states[1:]
    )
    return Nodes(left, right, left_rate, right_rate)


def _of_state(model: Model, state, field):
    """Return channels that depend on the state, and their rates, shapes `(c,)`."""
    lags = filtered_channels(model)
    size = state.shape[0] - len(lags)
    values, rates = [], []
    for name, sensor in model.sensors.items():
        if sensor.filtered:
            place = size + lags.index(name)
            value, slope = state[place], field[place]
        else:

            def seen(x, sensor=sensor):
                return sensor.seen(model.system, 0.0, x)

            value, slope = jax.jvp(seen, (state[:size],), (field[:size],))
        values.append(value)
        rates.append(slope)
    return jnp.stack(values), jnp.stack(rates)


def _of_motion(model: Model, system_at, t, state):
    """Return all channels and their rates, shapes `(c,)`."""
    lags = filtered_channels(model)
    size = state.shape[0] - len(lags)

    def read(t, state):
        return jnp.stack(
            [
                state[size + lags.index(name)]
                if sensor.filtered
                else sensor.seen(system_at(t), t, state[:size])
                for name, sensor in model.sensors.items()
            ]
        )

    field = augmented_field(model, system_at(t), t, state)
    return jax.jvp(read, (t, state), (jnp.ones_like(t), field))
