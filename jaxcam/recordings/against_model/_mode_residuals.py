"""Compute residuals of a model in each mode: in flight, in contact and at impacts."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ...hybrid.programs import program
from .._units import unit_of
from ..cut import Flight, padded, Segments
from ._comparison import Residuals
from ._flight_fit import fit_flights, observed, rate_of, size_of, state_at


# Minimum number of samples in a flight; a shorter flight determines only its initial
# state and shows no residuals
_LEAST_SAMPLES = 16


def _rows(segments: Segments, flight: Flight) -> np.ndarray:
    """Return the samples of a flight that are certainly between its two ends."""
    time = segments.recording.time
    margin = segments.recording.interval / 2
    rows = np.arange(flight.first, flight.last)
    if flight.start.kind != "end of record":
        rows = rows[time[rows] >= flight.start.time + margin]
    if flight.stop.kind != "end of record":
        rows = rows[time[rows] <= flight.stop.time - margin]
    return rows


def in_flight(system, segments, observe, noise, clock):
    """Return the residuals of each channel in flight, after the initial states have
    been fitted, and notes on omitted flights.
    """
    recording = segments.recording
    pieces = [(i, _rows(segments, f)) for i, f in enumerate(segments.flights)]
    pieces = [(i, rows) for i, rows in pieces if len(rows) >= _LEAST_SAMPLES]
    if not pieces:
        return [], [f"{recording.name} has no flight of {_LEAST_SAMPLES} samples."]
    size = size_of(system, observe)
    sigma = np.array([noise[channel] for channel in observe])
    samples = np.stack([recording[channel] for channel in observe])
    fits = fit_flights(
        system,
        [recording.time[rows] for _, rows in pieces],
        [samples[:, rows] for _, rows in pieces],
        [float(clock[rows[0]]) for _, rows in pieces],
        list(observe.values()),
        sigma,
        size,
    )
    good = np.all(np.isfinite(fits.residual), axis=(1, 2))
    lost = [i for (i, _), fine in zip(pieces, good) if not fine]
    notes = []
    if lost:
        start = segments.flights[lost[0]].start.time
        notes = [
            f"In {recording.name}, the model could not follow {len(lost)} flights, the "
            f"first of them from {start:.3f} s; they are omitted."
        ]
    kept = [(k, i, rows) for k, (i, rows) in enumerate(pieces) if good[k]]
    if not kept:
        return [], notes
    every = np.concatenate([rows for _, _, rows in kept])
    piece = np.concatenate([np.full(len(rows), i) for _, i, rows in kept])
    parts = []
    for column, channel in enumerate(observe):
        values = [fits.residual[k, column, : len(rows)] for k, _, rows in kept]
        parts.append(
            Residuals(
                recording.name,
                "flight",
                channel,
                unit_of(channel),
                recording.time[every],
                _turned(segments)[every],
                np.concatenate(values),
                np.full(len(every), sigma[column]),
                piece,
                # the fitted initial states use degrees of freedom, in equal shares from
                # the channels
                fitted=round(size * len(kept) / len(observe)),
            )
        )
    return parts, notes


def in_contact(system, segments, pick, clock) -> list[Residuals]:
    """Return the residuals of the channel in contact: its samples minus its value on
    the model's surface.
    """
    time = segments.recording.time
    contacts = enumerate(segments.contacts)
    kept = [(i, np.flatnonzero(segments.resting(part))) for i, part in contacts]
    kept = [(i, rows) for i, rows in kept if len(rows)]
    if not kept:
        return []
    rows = np.concatenate([rows for _, rows in kept])
    samples = segments.recording[segments.channel][rows]
    size = size_of(system, {segments.channel: pick})
    zero = np.zeros((len(rows), 1))
    state = state_at(system, [pick], clock[rows], samples[:, None], zero, size)
    return [
        Residuals(
            segments.recording.name,
            "contact",
            segments.channel,
            unit_of(segments.channel),
            time[rows],
            _turned(segments)[rows],
            _distance(system, pick, clock[rows], state),
            np.full(len(rows), segments.noise),
            np.concatenate([np.full(len(rows), i) for i, rows in kept]),
        )
    ]


def at_impacts(system, segments, pick, clock) -> list[Residuals]:
    """Return the residuals of the positions of impacts and of the speeds after them."""
    found = segments.impacts
    sharp = found.time_stderr < 2 * segments.recording.interval
    if not np.any(sharp):
        return []
    moment, angle, rate = found.time[sharp], found.angle[sharp], found.before[sharp]
    at = np.interp(moment, segments.recording.time, clock)
    size = size_of(system, {segments.channel: pick})
    before = state_at(system, [pick], at, angle[:, None], rate[:, None], size)
    place = _distance(system, pick, at, before)
    count = len(at)
    after, gain = _after_impact(system, pick, padded(at), padded(before))
    error = np.hypot(
        found.after_stderr[sharp],
        np.asarray(gain)[:count] * found.before_stderr[sharp],
    )
    unit = unit_of(segments.channel)
    turned = found.turned[sharp]
    number = np.flatnonzero(sharp)
    speed = found.after[sharp] - np.asarray(after)[:count]
    head = (segments.recording.name,)
    return [
        Residuals(
            *head,
            "impact position",
            segments.channel,
            unit,
            moment,
            turned,
            place,
            found.angle_stderr[sharp],
            number,
        ),
        Residuals(
            *head,
            "impact speed",
            segments.channel,
            unit and f"{unit}/s",
            moment,
            turned,
            speed,
            error,
            number,
        ),
    ]


def _distance(system, pick, clock, state) -> Float[np.ndarray, " k"]:
    """Return the distance of the channel from its value on the surface, shape
    `(k,)`.
    """
    off = _off_surface(system, pick, padded(clock), padded(state))
    return np.asarray(off)[: len(clock)]


@program
def _off_surface(system, pick, clock, state):
    """Return the gap, converted to the unit of the channel to first order, shape
    `(k,)`.
    """

    def one(clock, state):
        gap, slope = jax.value_and_grad(lambda x: _nearest(system, clock, x))(state)
        channel = jax.grad(lambda x: observed(pick, x))(state)
        # the gap, divided by its derivative with respect to the channel along the
        # channel's gradient
        return gap * jnp.sum(channel**2) / jnp.sum(slope * channel)

    return jax.vmap(one)(jnp.asarray(clock), jnp.asarray(state))


def _nearest(system, clock, state):
    return jnp.min(jnp.atleast_1d(system.gap(clock, state)))


@program
def _after_impact(system, pick, clock, state):
    """Return the rate of the channel after the impact, and its derivative with respect
    to the rate before.
    """

    def one(clock, state):
        def after(state):
            landed = system.impact(clock, state)
            if landed.ndim == 2:
                landed = landed[jnp.argmin(system.gap(clock, state))]
            return rate_of(system, (pick,), clock, landed)[0]

        def before(state):
            return rate_of(system, (pick,), clock, state)[0]

        # differentiate along the gradient of the rate, scaled so that the rate changes
        # by one
        direction = jax.grad(before)(state)
        size = jnp.sum(direction**2)
        value, change = jax.jvp(after, (state,), (direction / size,))
        return value, change

    return jax.vmap(one)(jnp.asarray(clock), jnp.asarray(state))


def _turned(segments: Segments) -> np.ndarray:
    if segments.drive is None:
        return np.full(len(segments.recording), np.nan)
    return segments.drive.angle
