"""Compute the gaps of a model from the measured components of its state."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..hybrid.programs import program
from ..recordings.cut import Drive, padded, saturated
from ._gap_rates import gap_rates
from .engine import (
    DriveState,
    Layout,
    Model,
    parameter_places,
    state_size,
)


# Number of samples at which the dependence of a gap on the state is evaluated
_LOOKS = 64


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
    respect to the state `(g, n)`, their errors `(g,)`, and for each its measured rate
    of change `(k,)` or `None`.
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
    gaps = np.asarray(_gap(layout, values, *columns))[:count].T
    rows = np.linspace(0, count - 1, _LOOKS).astype(int)
    looks = [part[rows] for part in columns]
    by_state, by_value = (np.asarray(x) for x in _slopes(layout, values, *looks))
    slopes = np.max(np.abs(by_state), axis=0)
    moved = np.max(np.abs(by_value), axis=0)
    # a parameter that does not affect a gap and has no tolerance must not give zero
    # times infinity
    parts = np.where(moved > 0, moved * np.where(moved > 0, tolerances, 0.0), 0.0)
    rates: list = [None] * len(gaps)
    clear = [k for k, name in picks.items() if not np.any(saturated(recording[name]))]
    if len(picks) > 1:
        found = gap_rates(layout, values, tuple(columns), tuple(looks), clear)
        rates = [None if rate is None else rate[:count] for rate in found]
    return gaps, slopes, np.sum(parts, axis=-1), rates


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
