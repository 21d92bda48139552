"""Check that the steps of pieces are short enough for the model and its sensors."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np

from ...hybrid.programs import program
from ._layout import Layout
from ._linear import Extras
from ._linearise import Point
from ._model import DriveState, Input, Model
from ._pieces import Pieces
from ._predict import end_of_flight, fly


# Allowed change of a state (in units of the error of a piece's state) when the length
# of the substeps is halved
_STEP_ERROR = 0.01
_MOST_SUBSTEPS = 16
# Allowed error (in units of the noise) of the cubics between the ends of the steps
_CUBIC_ERROR = 0.05
# Number of pieces in a flight above which the allowed change decreases, because errors
# accumulate along a flight
_LONG = 16
# Largest step, relative to the time constant of a sensor filter; the error of the cubic
# Hermite interpolation is then 1e-4 of a jump
_FILTER_STEP = 0.4
# A larger number of steps is rounded up to a multiple of this, so that similar problems
# share a program
_MULTIPLE = 20


def longest_flight(cuts) -> int:
    pieces = (np.array([span.flight for span in side]) for side, _ in cuts)
    counts = (np.unique(part, return_counts=True)[1] for part in pieces)
    return max(int(np.max(count, initial=0)) for count in counts)


def steps_for_inputs(model: Model, segments, pieces: Pieces, steps: int) -> int:
    """Return the number of steps of a piece that resolve the input and the sensor
    filters, at least the present number `steps`.

    A step must not be longer than the interval between the samples of an input. It must
    also resolve the settling of a filter after an impact, which `followed_by_cubics`
    does not show, because the estimated initial states assume settled filters.
    """
    longest = steps * float(np.max(np.where(pieces.exists, pieces.flown.step, 0.0)))
    interval = min(part.recording.interval for part in segments)
    bounds = [
        _FILTER_STEP / (2 * np.pi * s.bandwidth_hz)
        for s in model.sensors.values()
        if s.filtered
    ]
    if isinstance(model.drive, Input):
        bounds.append(interval)
    needed = max((longest / bound for bound in bounds), default=0.0)
    if needed <= steps:
        return steps
    return _MULTIPLE * math.ceil(needed / _MULTIPLE)


def followed_by_cubics(layout: Layout, pieces: Pieces, point: Point) -> bool:
    """Return whether the cubics between the ends of the steps are close to the motion.

    They are compared with the integrated motion in the middle of each step.
    """
    off = np.abs(_off_middles(layout, pieces, point))
    sensors = layout.model.sensors.values()
    floors = np.array([float(one.floor / abs(one.gain)) for one in sensors])
    inside = pieces.exists[..., None]
    return bool(np.max(np.where(inside, off / floors, 0.0)) < _CUBIC_ERROR)


def enough_substeps(
    layout: Layout, pieces: Pieces, extras: Extras, point: Point, flight: int
) -> Pieces:
    """Return the pieces with so many substeps that doubling their number changes every
    state by much less than its error.

    **Arguments:** `flight` is the number of pieces in the longest flight.
    """
    # errors of the same sign accumulate over a flight of many pieces, like a frequency
    # error
    part_of_error = _STEP_ERROR / max(1.0, flight / _LONG) ** 1.5
    scale = np.asarray(extras.sharpness.piece)
    inside = np.asarray(pieces.exists)[..., None]
    substeps = int(np.max(pieces.substeps))
    coarse = _ends(layout, pieces, point, jnp.asarray(substeps))
    while substeps < _MOST_SUBSTEPS:
        fine = _ends(layout, pieces, point, jnp.asarray(2 * substeps))
        change = np.abs(coarse - fine) / scale
        if np.max(np.where(inside, change, 0.0)) < part_of_error:
            break
        substeps, coarse = 2 * substeps, fine
    filled = np.full_like(np.asarray(pieces.substeps), substeps)
    return dataclasses.replace(pieces, substeps=filled)


@program
def _ends(layout: Layout, pieces: Pieces, point: Point, substeps):
    """Return the states at the ends of all pieces; one program serves every number of
    substeps.
    """

    def one(model, *piece):
        return end_of_flight(model, *piece, substeps=substeps)

    return _of_each(layout, pieces, point, one)


@program
def _off_middles(layout: Layout, pieces: Pieces, point: Point):
    """Return the largest error of the cubics in each piece and channel, `(r, k, c)`."""

    def one(model, state, start, step, drive):
        # the drive in the two halves of each step, within which drive and input are
        # linear
        twice = DriveState(*(jnp.repeat(part, 2, axis=-1) for part in drive))
        quarter = jnp.tile(jnp.array([-0.25, 0.25]), drive.angle.shape[-1]) * step
        twice = twice._replace(angle=twice.angle + quarter * twice.rate)
        _, halves = fly(model, state, start, step / 2, twice)
        left, middle, right = halves.left[::2], halves.right[::2], halves.right[1::2]
        bend = (halves.left_rate[::2] - halves.right_rate[1::2]) * step / 8
        return jnp.max(jnp.abs((left + right) / 2 + bend - middle), axis=0)

    return _of_each(layout, pieces, point, one)


def _of_each(layout: Layout, pieces: Pieces, point: Point, one):
    """Apply a function to each piece and the model of its recording."""
    part = pieces.flown

    def record(values, *inputs):
        model = layout.at(values)
        return jax.vmap(lambda *piece: one(model, *piece))(*inputs)

    times = jnp.asarray(part.start), jnp.asarray(part.step)
    return jax.vmap(record)(point.values, point.states, *times, pieces.drive)
