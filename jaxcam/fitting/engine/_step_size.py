"""Check that the steps of pieces are short enough for the model and its sensors."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np

from ...hybrid import SwitchedSystem
from ...hybrid.programs import program
from ._driven_steps import input_in_steps, lines_in_parts
from ._extras import Extras
from ._fly import end_of_flight, fly_without_derivatives
from ._layout import Layout
from ._linearise import Point
from ._model import DriveState, Input, Model
from ._output import Output
from ._pieces import Pieces


# Allowed change of a state (in units of the error of a piece's state) when the length
# of the substeps is halved
_STEP_ERROR = 0.01
_MOST_SUBSTEPS = 16
# Allowed error (in units of the noise) of the cubics between the ends of the steps
_CUBIC_ERROR = 0.05
# Allowed change of a channel (in units of the noise) if the input followed its samples
# within the steps; with more samples than the second number, it decreases like a
# standard error
_LINE_ERROR, _FEW_SAMPLES = 0.05, 1000
# Number of pieces in a flight above which the allowed change decreases, because errors
# accumulate along a flight
_LONG = 16
# Largest step, relative to the time constant of a sensor filter; the error of the cubic
# Hermite interpolation is then 1e-4 of a jump
_FILTER_STEP = 0.4
# Largest substep, relative to this time constant, for an accelerometer: the error of
# the filter state is then 4e-6 of a shock
_SHAKEN_SUBSTEP = 0.15
# A larger number of steps is rounded up to a multiple of this, so that similar problems
# share a program
_MULTIPLE = 20


def longest_flight(cuts) -> int:
    pieces = (np.array([span.flight for span in side]) for side, _ in cuts)
    counts = (np.unique(part, return_counts=True)[1] for part in pieces)
    return max(int(np.max(count, initial=0)) for count in counts)


def steps_for_filters(model: Model, pieces: Pieces, steps: int) -> int:
    """Return the number of steps of a piece that resolve the sensor filters, at least
    the present number `steps`.

    The steps must resolve the settling of a filter after an impact, which
    `followed_by_cubics` does not show, because the estimated initial states assume
    settled filters.
    """
    bounds = [
        _FILTER_STEP / (2 * np.pi * s.bandwidth_hz)
        for s in model.sensors.values()
        if s.filtered
    ]
    return _steps_of(min(bounds), pieces, steps) if bounds else steps


def steps_of_samples(segments, pieces: Pieces, steps: int) -> int:
    """Return the number of steps of a piece that are as short as the interval between
    the samples, at least the present number `steps`.
    """
    return _steps_of(min(part.recording.interval for part in segments), pieces, steps)


def _steps_of(length: float, pieces: Pieces, steps: int) -> int:
    """Return the number of steps not longer than `length` (s), at least the present
    number `steps`.
    """
    longest = steps * float(np.max(np.where(pieces.exists, pieces.flown.step, 0.0)))
    if longest / length <= steps:
        return steps
    return _MULTIPLE * math.ceil(longest / length / _MULTIPLE)


def followed_by_lines(
    layout: Layout, segments, pieces: Pieces, point: Point, most: int
) -> bool:
    """Return whether the channels would hardly change if the input followed its samples
    within each step, instead of a line.

    The motion is integrated twice in short steps: with the lines, and with the input as
    it is.

    Args:
        layout: The model, with an input or without one.
        segments: The recordings.
        pieces: Their pieces.
        point: Parameter values, and states at the beginning of the pieces.
        most: Number of short steps in a piece, at least.

    Returns:
        Whether the change is much smaller than the noise, or no step is longer than the
        interval between the samples.
    """
    source, steps = layout.model.drive, pieces.steps
    if not isinstance(source, Input):
        return True
    if steps >= min(most, steps_of_samples(segments, pieces, steps)):
        return True
    parts = math.ceil(most / steps)
    start, step = np.asarray(pieces.flown.start), np.asarray(pieces.flown.step)
    short = step / parts
    edges = start[..., None] + short[..., None] * np.arange(parts * steps + 1)
    both = (
        lines_in_parts(pieces.drive, step, parts),
        input_in_steps(segments, source, edges),
    )
    lined, given = (
        np.asarray(_seen(layout, start, short, drive, point)) for drive in both
    )
    sensors = layout.model.sensors.values()
    floors = np.array([float(one.floor / abs(one.gain)) for one in sensors])
    off = np.max(np.abs(lined - given), axis=-2) / floors
    samples = int(np.sum(np.asarray(pieces.flown.known)))
    # errors of the same sign in all pieces become visible as the data grow
    allowed = _LINE_ERROR * min(1.0, math.sqrt(_FEW_SAMPLES / max(1, samples)))
    return bool(np.max(np.where(pieces.exists[..., None], off, 0.0)) < allowed)


@program
def _seen(layout: Layout, start, step, drive: DriveState, point: Point):
    """Return the channels at the ends of all steps but the first, `(r, k, n, c)`."""

    def one(model, *piece, discrete):
        return fly_without_derivatives(model, *piece, discrete=discrete)[1].right

    return _of_each(layout, (start, step, drive), point, one)


def followed_by_cubics(layout: Layout, pieces: Pieces, point: Point) -> bool:
    """Return whether the cubics between the ends of the steps are close to the motion.

    They are compared with the integrated motion in the middle of each step.
    """
    off = np.abs(_off_middles(layout, pieces, point))
    sensors = layout.model.sensors.values()
    floors = np.array([float(one.floor / abs(one.gain)) for one in sensors])
    inside = pieces.exists[..., None]
    return bool(np.max(np.where(inside, off / floors, 0.0)) < _CUBIC_ERROR)


def least_substeps(model: Model, segments, pieces: Pieces) -> Pieces:
    """Return the pieces with substeps as short as the samples, if a measured input
    drives a switched system: two crossings in one substep would be missed. If there is
    an accelerometer, its filter must be followed after the shock of an impact.
    """
    least = 1.0
    if isinstance(model.drive, Input) and isinstance(model.system, SwitchedSystem):
        least = steps_of_samples(segments, pieces, pieces.steps) / pieces.steps
    longest = float(np.max(np.where(pieces.exists, pieces.flown.step, 0.0)))
    for one in model.sensors.values():
        if one.filtered and isinstance(one.observe, Output):
            settles = 1 / (2 * np.pi * one.bandwidth_hz)
            least = max(least, longest / (_SHAKEN_SUBSTEP * settles))
    return _divided(pieces, min(math.ceil(least), _MOST_SUBSTEPS))


def _divided(pieces: Pieces, substeps: int) -> Pieces:
    filled = np.full_like(np.asarray(pieces.substeps), substeps)
    return dataclasses.replace(pieces, substeps=filled)


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
    return _divided(pieces, substeps)


@program
def _ends(layout: Layout, pieces: Pieces, point: Point, substeps):
    """Return the states at the ends of all pieces; one program serves every number of
    substeps.
    """

    def one(model, *piece, discrete):
        return end_of_flight(model, *piece, substeps=substeps, discrete=discrete)

    return _of_each(layout, _flights(pieces), point, one)


@program
def _off_middles(layout: Layout, pieces: Pieces, point: Point):
    """Return the largest error of the cubics in each piece and channel, `(r, k, c)`."""

    def one(model, state, start, step, drive, discrete):
        # the drive in the two halves of each step, within which drive and input are
        # linear
        twice = DriveState(*(jnp.repeat(part, 2, axis=-1) for part in drive))
        quarter = jnp.tile(jnp.array([-0.25, 0.25]), drive.angle.shape[-1]) * step
        twice = twice._replace(angle=twice.angle + quarter * twice.rate)
        given = model, state, start, step / 2, twice
        _, halves = fly_without_derivatives(*given, discrete=discrete)
        left, middle, right = halves.left[::2], halves.right[::2], halves.right[1::2]
        bend = (halves.left_rate[::2] - halves.right_rate[1::2]) * step / 8
        return jnp.max(jnp.abs((left + right) / 2 + bend - middle), axis=0)

    return _of_each(layout, _flights(pieces), point, one)


def _of_each(layout: Layout, flights, point: Point, one):
    """Apply a function to each piece and the model of its recording.

    **Arguments:** `flights` are the beginnings of the pieces, the lengths of their
    steps, and their drive.
    """

    def record(values, discrete, *inputs):
        model = layout.at(values)

        def piece(discrete, *given):
            return one(model, *given, discrete=discrete)

        return jax.vmap(piece)(discrete, *inputs)

    arrays = jax.tree.map(jnp.asarray, flights)
    return jax.vmap(record)(point.values, point.discrete, point.states, *arrays)


def _flights(pieces: Pieces):
    return pieces.flown.start, pieces.flown.step, pieces.drive
