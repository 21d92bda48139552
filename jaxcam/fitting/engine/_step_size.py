"""Check that the steps of pieces are short enough for the model and its sensors."""

import jax
import jax.numpy as jnp
import numpy as np

from ._linear import Extras
from ._linearise import Layout, Point
from ._model import Input, Model
from ._pieces import Pieces
from ._predict import fly
from ._program import program


# Allowed change (in units of the noise) when the steps are halved
_STEP_ERROR = 0.01
# Number of pieces above which the limit decreases, because errors accumulate along a
# flight
_LONG = 16
# Step divided by the time constant of a filter; the Hermite error is then 1e-4 of a
# jump
_FILTER_STEP = 0.4


def longest_flight(cuts) -> int:
    pieces = (np.array([span.flight for span in side]) for side, _ in cuts)
    counts = (np.unique(part, return_counts=True)[1] for part in pieces)
    return max(int(np.max(count, initial=0)) for count in counts)


def follows_inputs(model: Model, segments, pieces: Pieces) -> bool:
    """Return whether the steps are short compared with sensor filters and input.

    A filter is not settled after an impact, which the initial states do not account
    for.
    """
    longest = float(np.max(np.where(pieces.exists, pieces.flown.step, 0.0)))
    interval = min(part.recording.interval for part in segments)
    if isinstance(model.drive, Input) and longest > interval:
        return False
    corners = [2 * np.pi * s.bandwidth_hz for s in model.sensors.values() if s.filtered]
    return all(longest * corner <= _FILTER_STEP for corner in corners)


def fine_enough(
    layout: Layout, pieces: Pieces, extras: Extras, point: Point, flight: int
) -> bool:
    """Return whether halving the steps changes all states by less than their errors.

    **Arguments:** `flight` is the number of pieces in the longest flight.
    """
    part = pieces.flown
    rate = np.repeat(pieces.rate, 2, axis=-1)
    # a quarter of a step before and after the middle, because the drive turns uniformly
    quarter = np.asarray(part.step)[..., None] / 4
    sign = np.tile([-1.0, 1.0], pieces.rate.shape[-1])
    half = np.repeat(pieces.angle, 2, axis=-1) + sign * quarter * rate, rate
    coarse = _ends(layout, point, part.start, part.step, pieces.angle, pieces.rate)
    fine = _ends(layout, point, part.start, part.step / 2, *half)
    change = np.abs(coarse - fine) / np.asarray(extras.sharpness.piece)
    # errors of the same sign accumulate over a flight of many pieces, like a frequency
    # error
    part_of_error = _STEP_ERROR / max(1.0, flight / _LONG) ** 1.5
    return bool(np.max(np.where(pieces.exists[..., None], change, 0.0)) < part_of_error)


@program
def _ends(layout: Layout, point: Point, start, step, angle, rate):
    def one(values, *piece):
        model = layout.at(values)
        return jax.vmap(lambda *inputs: fly(model, *inputs)[0])(*piece)

    drive = (jnp.asarray(part) for part in (start, step, angle, rate))
    return jax.vmap(one)(point.values, point.states, *drive)
