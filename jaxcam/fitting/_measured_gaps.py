"""Compute the gaps of a model from the measured components of its state."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..hybrid.programs import program
from ..recordings.cut import Drive, padded, saturated
from ._gap_rates import gap_rates
from ._gaps_at_impacts import (
    fitted_to_impacts,
    FittedValues,
    gap_points,
    GapPoints,
)
from .engine import (
    DriveState,
    Layout,
    Model,
    moves_surface,
    parameter_places,
    state_size,
)


# Number of samples at which the dependence of a gap on the state is evaluated
_LOOKS = 64
# Largest error of a gap that is fitted to impacts, in standard deviations
_SURE = 3.0


def measured_states(model: Model, picks, recording) -> Float[np.ndarray, "k n"]:
    """Return the state at each sample; components that are not measured are zero."""
    size = state_size(model)
    states = np.zeros((len(recording), size))
    for place, name in picks.items():
        sensor = model.sensors[name]
        samples = (recording[name] - float(sensor.offset)) / float(sensor.gain)
        states[:, place] = samples
    return states


def measured_gaps(
    model: Model, parameters, recording, states, drive: Drive | None, picks
):
    """Return the gaps `(g, k)`, the largest magnitudes of their derivatives with
    respect to the state `(g, n)`, their errors `(g,)`, for each its measured rate of
    change `(k,)` or `None`, and the model that has these gaps.

    If the surfaces move, and their parameters are uncertain, the model is changed so
    that the gaps vanish at the impacts.
    """
    layout = Layout(model, parameter_places(model, parameters))
    values = np.array([float(p.where(model)) for p in parameters])
    tolerances = np.array([p.tolerance for p in parameters])
    count = len(recording)
    moving = (
        (np.zeros(count), np.ones(count), np.zeros(count))
        if drive is None
        else (drive.angle, drive.rate, drive.acceleration.values)
    )
    columns = [padded(part) for part in (recording.time, states, *moving)]
    rows = np.linspace(0, count - 1, _LOOKS).astype(int)
    looks = [part[rows] for part in columns]

    def gaps_and_slopes(values):
        gaps = np.asarray(_gap(layout, values, *columns))[:count].T
        return gaps, *(np.asarray(x) for x in _slopes(layout, values, *looks))

    gaps, by_state, by_value = gaps_and_slopes(values)
    # a parameter that does not affect a gap and has no tolerance must not give zero
    # times infinity
    moved = np.max(np.abs(by_value), axis=0, initial=0.0)
    parts = np.where(moved > 0, moved * np.where(moved > 0, tolerances, 0.0), 0.0)
    errors = np.sum(parts, axis=-1)
    if moves_surface(model.system, states[0]) and np.any(errors > 0):
        points = gap_points(recording.time, gaps, errors, recording.interval)
        at = _at_points(layout, points, (recording.time, states, *moving))
        found = fitted_to_impacts(points, at, parameters, values)
        if found is not None:
            values = found.values
            gaps, by_state, by_value = gaps_and_slopes(values)
            least = np.minimum(_errors(found, points, by_value), errors)
            # an error that other parameters cause remains as it was
            known = np.all((parts == 0) | found.fitted, axis=-1)
            errors = np.where(known, least, errors)
    slopes = np.max(np.abs(by_state), axis=0)
    rates: list = [None] * len(gaps)
    clear = [k for k, name in picks.items() if not np.any(saturated(recording[name]))]
    if len(picks) > 1:
        found = gap_rates(layout, values, tuple(columns), tuple(looks), clear)
        rates = [None if rate is None else rate[:count] for rate in found]
    return gaps, slopes, errors, rates, layout.at(jnp.asarray(values))


def _errors(
    found: FittedValues, points: GapPoints, by_value: Float[np.ndarray, "k g p"]
) -> Float[np.ndarray, " g"]:
    """Return the largest errors of the gaps that were fitted to impacts: those of the
    parameters, and the gaps that remain at the impacts.
    """
    gaps, on = by_value.shape[1], np.isfinite(found.left)
    spread = np.einsum("kgp,pq,kgq->kg", by_value, found.covariance, by_value)
    counts = np.bincount(points.gap[on], minlength=gaps)
    left = np.bincount(points.gap[on], found.left[on] ** 2, gaps)
    return _SURE * np.sqrt(np.max(spread, axis=0) + left / np.maximum(counts, 1))


def _at_points(layout: Layout, points: GapPoints, columns):
    """Return a function that maps values of the parameters to the gaps at impacts
    `(i,)`, and to their derivatives `(i, p)`.
    """
    time, count = columns[0], len(points.time)
    at = [points.time]
    for column in columns[1:]:
        flat = column.reshape(len(time), -1).T
        seen = np.stack([np.interp(points.time, time, own) for own in flat], axis=-1)
        at.append(seen.reshape(count, *column.shape[1:]))
    at = [padded(part) for part in at]
    each = np.arange(count), points.gap

    def gaps_of(values):
        _, by_value = _slopes(layout, values, *at)
        return np.asarray(_gap(layout, values, *at))[each], np.asarray(by_value)[each]

    return gaps_of


@program
def _gap(layout: Layout, values, times, states, *drive):
    return jax.vmap(lambda *at: gaps_at(layout, values, *at))(
        *(jnp.asarray(x) for x in (times, states, *drive))
    )


@program
def _slopes(layout: Layout, values, times, states, *drive):
    """Return the derivatives of the gaps with respect to the state and the parameters,
    sample by sample.
    """

    def one(time, state, *drive):
        by_state = jax.jacfwd(lambda x: gaps_at(layout, values, time, x, *drive))
        by_value = jax.jacfwd(lambda v: gaps_at(layout, v, time, state, *drive))
        return by_state(state), by_value(values)

    values = jnp.asarray(values)
    return jax.vmap(one)(*(jnp.asarray(x) for x in (times, states, *drive)))


def gaps_at(layout: Layout, values, time, state, *drive):
    system = layout.at(jnp.asarray(values)).driven(time, DriveState(*drive))
    return jnp.atleast_1d(system.gap(time, state))
