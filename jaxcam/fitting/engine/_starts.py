"""Estimate initial states of the pieces of a recording."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from ...recordings import Segments
from ...recordings.against_model import size_of, state_at
from ...recordings.cut import fit_local
from ._model import filtered_channels, Model, state_channels
from ._pieces import Pieces, Span


def state_size(model: Model) -> int:
    """Return the number of components of the system's state."""
    return size_of(model.system, state_channels(model))


def suggested_starts(model: Model, segments, cuts, pieces: Pieces):
    """Return initial states estimated from polynomials fitted to the samples: those of
    the pieces in flight, `(r, k, n)`, and reference states for the pieces in contact.
    """
    size = state_size(model)
    lags = filtered_channels(model)
    sensors = model.sensors
    observed = state_channels(model)
    direct = [name for name in observed if name not in lags] or list(observed)
    if not direct:
        raise ValueError(
            "every channel is an output, such as that of an accelerometer, so the "
            "initial states are unknown; add a sensor for a component of the state"
        )
    states = np.zeros((*pieces.joint.shape, size + len(lags)))
    guess = np.zeros((*pieces.rest_exists.shape, size))
    for row, (part, sides) in enumerate(zip(segments, cuts)):
        for side, found in zip(sides, (states, guess)):
            if not side:
                continue
            clock = np.array([span.start for span in side])
            local = [
                [_local(part, span, name, sensors[name]) for name in direct]
                for span in _with_samples(side)
            ]
            both = np.array(local)
            picks = [observed[name] for name in direct]
            system = _still(model, part)
            known = both[..., 0], both[..., 1]
            state = np.array(state_at(system, picks, clock, *known, size))
            for place, pick in enumerate(picks):
                if isinstance(pick, int):
                    # a measured component is known better than from noisy slopes
                    state[:, pick] = both[:, place, 0]
            found[row, : len(side), :size] = state
            if found is states:
                for place, name in enumerate(lags):
                    seen = partial(sensors[name].seen, system)
                    found[row, : len(side), size + place] = jax.vmap(seen)(
                        jnp.asarray(clock), jnp.asarray(state)
                    )
    return states, guess


def _still(model: Model, part: Segments):
    """Return the system with its drive at the mean speed; its vector field is only used
    to estimate initial states.
    """
    if part.drive is None:
        return model.system
    return model.uniform(part.drive.phase, part.drive.speed)


def _with_samples(side: list[Span]):
    """Yield the pieces; one with too few samples for a polynomial also gets the samples
    of its neighbours.
    """
    for k, span in enumerate(side):
        if len(span.rows) >= 4:
            yield span
            continue
        near = [s for s in side[max(0, k - 1) : k + 2] if s.flight == span.flight]
        rows = np.concatenate([s.rows for s in near])
        yield dataclasses.replace(span, rows=rows)


def _local(part: Segments, span: Span, channel: str, sensor):
    """Return value and slope of a channel at the beginning of a piece."""
    time = part.recording.time[span.rows]
    values = part.recording[channel][span.rows]
    fine = np.isfinite(values)
    if np.sum(fine) < 2:
        return 0.0, 0.0
    fit = fit_local(time[fine], values[fine], float(sensor.floor), span.start)
    return fit.value(span.start), fit.slope(span.start)
