"""Compare the range of the recordings with the positions of the stops of the model."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..recordings.cut import Segments
from ..recordings.files import unit_of
from ._measured_gaps import measured_gaps, measured_states
from .engine import (
    DriveState,
    measured_components,
    Model,
    Parameter,
    with_constants,
)


# A motion is far beyond a stop if more than this fraction of the samples is
_OFTEN = 0.01
# by more than this many times the noise and this fraction of the range of the gap, in
# addition to the tolerances
_NOISES, _DEEP = 10.0, 0.1
# Number of samples at which a contact must be at the same position to count as fixed
_LOOKS = 5
# Maximum number of Newton steps to a contact, and their relative tolerance
_NEWTON, _CLOSE = 30, 1e-9
# The unit of a column that is easily mistaken for another
_MISTAKEN = {"m": "m or mm?", "rad": "rad or deg?"}


class _Seen(NamedTuple):
    """A gap that depends on one measured component: by recording, the positions `(k,)`,
    the gaps `(k,)`, and functions that return positions of the contact.
    """

    name: str
    coordinate: str
    unit: str
    positions: list[Float[np.ndarray, " k"]]
    gaps: list[Float[np.ndarray, " k"]]
    contacts: list[Callable[[], Float[np.ndarray, " looks"]]]
    error: float
    noise: float


def contact_in_doubt(
    model: Model, parameters: Sequence[Parameter], segments: Sequence[Segments]
) -> str:
    """Return a sentence if no recording shows an impact although the system has stops,
    or if a recording lies far beyond a stop.

    Both can be due to a column in another unit than stated, for which a fit finds
    precise but wrong parameters. A recording without impacts may also be intended.

    **Returns:** an empty string if there is no such doubt.
    """
    places = measured_components(model)
    picks = {place: name for name, place in reversed(tuple(places.items()))}
    seen = _seen_gaps(model, parameters, segments, picks)
    beyond = [sentence for one in seen if (sentence := _beyond(one, segments))]
    if beyond:
        return beyond[0]
    silent = not any(part.impacts.count or part.contacts for part in segments)
    return _untouched(seen) if seen and silent else ""


def _seen_gaps(model, parameters, segments, picks) -> list[_Seen]:
    """Return the gaps that depend on one component of the state, which is measured."""
    found: dict[int, list] = {}
    for part in segments:
        run = part.recording
        states = measured_states(model, picks, run)
        here = with_constants(model, run)
        gaps, slopes, errors, _, here = measured_gaps(
            here, tuple(parameters), run, states, part.drive, picks
        )
        for number, row in enumerate(slopes):
            along = np.flatnonzero(row)
            if len(along) == 1 and along[0] in picks:
                place = int(along[0])
                sensor = model.sensors[picks[place]]
                noise = row[place] * float(sensor.floor) / abs(float(sensor.gain))
                at = partial(_contacts, here, part, states, number, place)
                read = _reading_error(model, parameters, picks[place], states[:, place])
                error = errors[number] + row[place] * read
                one = place, states[:, place], gaps[number], error, noise, at
                found.setdefault(number, []).append(one)
    names, stops = model.system.state_names, model.system.constraint_names
    seen = []
    for number, rows in found.items():
        place = rows[0][0]
        seen.append(
            _Seen(
                stops[number] if stops else "",
                names[place] if names else picks[place],
                unit_of(picks[place]),
                [row[1] for row in rows],
                [row[2] for row in rows],
                [row[5] for row in rows],
                max(row[3] for row in rows),
                max(row[4] for row in rows),
            )
        )
    return seen


def _reading_error(model: Model, parameters, channel: str, values) -> float:
    """Return the largest error of a measured component, of the given values, that the
    tolerances of its sensor's offset and gain allow.
    """
    sensor = model.sensors[channel]

    def tolerance(number) -> float:
        found = [p.tolerance for p in parameters if p.where(model) is number]
        return max(found, default=0.0)

    per_gain = tolerance(sensor.gain) * float(np.nanmax(np.abs(values)))
    return (tolerance(sensor.offset) + per_gain) / abs(float(sensor.gain))


def _contacts(
    model: Model, part: Segments, states, number: int, place: int
) -> Float[np.ndarray, " looks"]:
    """Return the positions at which a gap is zero, at a few samples; NaN if there is no
    such position.
    """
    clock, found = part.recording.time, []
    for k in np.linspace(0, len(states) - 1, _LOOKS).astype(int):
        drive = part.drive
        turned = (0.0, 1.0, 0.0)
        if drive is not None:
            turned = drive.angle[k], drive.rate[k], drive.acceleration.values[k]
        time = jnp.asarray(float(clock[k]))
        system = model.driven(time, DriveState(*map(jnp.asarray, turned)))

        def gap(x, system=system, time=time, state=jnp.asarray(states[k])):
            return jnp.atleast_1d(system.gap(time, state.at[place].set(x)))[number]

        found.append(_root(gap, float(states[k, place])))
    return np.array(found)


def _root(gap, x: float) -> float:
    slope = jax.grad(gap)
    for _ in range(_NEWTON):
        at = jnp.asarray(x)
        step = float(gap(at)) / float(slope(at)) if float(slope(at)) else np.nan
        x -= step
        if not abs(step) > _CLOSE * (1 + abs(x)):
            return x
    return np.nan


def _untouched(seen: Sequence[_Seen]) -> str:
    """Describe the distance between the motion and the stops."""
    first = seen[0]
    along = [one for one in seen if one.coordinate == first.coordinate]
    low = min(np.nanmin(one) for one in first.positions)
    high = max(np.nanmax(one) for one in first.positions)
    unit = f" {first.unit}" if first.unit else ""
    ends = " and ".join(_place(one) for one in along)
    return (
        f"No impact was found: {first.coordinate} ranges from {low:.3g} to {high:.3g}"
        f"{unit}, but {ends}. If the rig does hit a stop, check {_unit_of(first)} and "
        "the positions of the stops in the rig file."
    )


def _place(one: _Seen) -> str:
    unit = f" {one.unit}" if one.unit else ""
    stop = f" with {_the(one)}" if one.name else ""
    contacts = np.concatenate([found() for found in one.contacts])
    usual = float(np.median(contacts))
    # NaN, or a stop that moves, has no fixed position
    if not np.all(np.abs(contacts - usual) <= _CLOSE * (1 + abs(usual))):
        least = min(np.nanmin(gap) for gap in one.gaps)
        to = f" to {_the(one)}" if one.name else ""
        return f"the gap{to} is at least {least:.3g}{unit}"
    return f"contact{stop} is at {usual:.4g}{unit}"


def _the(one: _Seen) -> str:
    return f"the {one.name.replace('_', ' ')}"


def _beyond(one: _Seen, segments: Sequence[Segments]) -> str:
    """Describe a motion beyond a stop; empty if there is none."""
    for part, position, gap in zip(segments, one.positions, one.gaps):
        depth = -float(np.nanquantile(gap, _OFTEN))
        allowed = one.error + _NOISES * one.noise
        if not depth > max(allowed, _DEEP * float(np.nanmax(gap) - np.nanmin(gap))):
            continue
        deepest = float(position[np.nanargmin(gap)])
        unit = f" {one.unit}" if one.unit else ""
        return (
            f"In {part.recording.name}, {one.coordinate} reaches {deepest:.3g}{unit}, "
            f"although {_place(one)}: the motion goes beyond the stop by "
            f"{-float(np.nanmin(gap)):.3g}, whereas the tolerances and the noise allow "
            f"{allowed:.1g}. Check {_unit_of(one)}, its sign, and the positions of the "
            "stops in the rig file."
        )
    return ""


def _unit_of(one: _Seen) -> str:
    asked = _MISTAKEN.get(one.unit, "")
    return f"the unit of the column{f' ({asked})' if asked else ''}"
