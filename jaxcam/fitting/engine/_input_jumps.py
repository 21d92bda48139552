"""Samples of accelerometers at jumps of a measured input."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...hybrid.programs import program
from ...recordings import RecordingError, Segments
from ._driven_steps import input_at
from ._layout import Layout
from ._linearise import Point
from ._model import DriveState, filtered_channels, Input
from ._output import Output
from ._pieces import Pieces


# Smallest fraction of the samples of a channel that must remain
_LEAST = 0.5
# Part of a sampling interval: shortly before and after a sample
_BESIDE = 0.01


def without_jumps(
    layout: Layout, segments: Sequence[Segments], pieces: Pieces, point: Point
) -> Pieces:
    """Return the pieces without the samples of outputs at which the input jumps.

    An output, such as the reading of an accelerometer, jumps with the input. A sample
    at the time of a jump may have been taken before or after it, and a prediction, in
    which the input is linear within each step, contains a part of the jump. The sample
    is not used if this makes a difference that exceeds the noise, for the initial
    values of the parameters.

    Args:
        layout: The model, with an input or without one.
        segments: The recordings.
        pieces: Their pieces.
        point: Parameter values, and states at the beginning of the pieces.

    Returns:
        The pieces; the samples that are not used are not `known`.

    Raises:
        RecordingError: Nearly all samples of a channel would not be used.
    """
    source, sensors = layout.model.drive, layout.model.sensors.values()
    # the reading of a filtered sensor does not jump
    outputs = np.array(
        [isinstance(one.observe, Output) and not one.filtered for one in sensors]
    )
    if not isinstance(source, Input) or not np.any(outputs):
        return pieces
    flown = pieces.flown
    begin, step = (
        np.asarray(one)[..., None, None] for one in (flown.start, flown.step)
    )
    place, drive = np.asarray(flown.place), pieces.drive
    times = begin + (np.arange(pieces.steps)[:, None] + place) * step
    mean, slope = (np.asarray(one)[..., None] for one in (drive.angle, drive.rate))
    line = mean + slope * (place - 0.5) * step
    interval = np.array([part.recording.interval for part in segments])
    beside = _BESIDE * interval[:, None, None, None]
    error = np.max(
        [
            np.abs(input_at(segments, source, at).angle - line)
            for at in (times - beside, times + beside)
        ],
        axis=0,
    )
    effect = np.abs(_effects(layout, flown.start, pieces.drive_at, point))
    jumps = error[..., None] * effect[:, :, None, None] > 1.0
    known = np.asarray(flown.known) & ~(jumps & outputs)
    before, after = (
        np.sum(part, axis=(0, 1, 2, 3)) for part in (np.asarray(flown.known), known)
    )
    for name, count, left in zip(layout.model.sensors, before, after, strict=True):
        if left < _LEAST * count:
            raise RecordingError(
                f"The input `{source.channel}` jumps at nearly every sample, by more "
                f"than the noise of `{name}`, and it is not known whether a reading of "
                "this channel was taken before or after the jump: "
                f"{count - left} of {count} readings cannot be used. Leave this "
                "channel out, state its `bandwidth_hz`, or write `interpolation = "
                '"linear"` if the input is continuous.'
            )
    return dataclasses.replace(pieces, flown=dataclasses.replace(flown, known=known))


@program
def _effects(
    layout: Layout, start, begin: DriveState, point: Point
) -> Float[Array, "r k c"]:
    """Return the derivative of each channel with respect to the input at the beginning
    of each piece, in units of the noise.
    """

    def of_piece(model, start, here, state):
        def seen(level):
            system = model.driven(start, here._replace(angle=level))
            x = state[: state.shape[0] - len(filtered_channels(model))]
            readings = [
                one.gain * one.seen(system, start, x) / one.floor
                for one in model.sensors.values()
            ]
            return jnp.stack(readings)

        return jax.jacfwd(seen)(jnp.asarray(here.angle))

    def of_record(values, *pieces):
        return jax.vmap(of_piece, (None, 0, 0, 0))(layout.at(values), *pieces)

    return jax.vmap(of_record)(point.values, start, begin, point.states)
