"""Segment recordings of any system at gaps computed from its channels."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..recordings import Recording, RecordingError, segment
from ..recordings.cut import (
    Drive,
    GivenImpacts,
    read_drive,
    segment_gaps,
    Segments,
)
from ._measured_gaps import measured_gaps, measured_states
from ._missed_impacts import Spans, with_missed_impacts
from ._time_unit import refuse_slow_samples
from .engine import (
    measured_components,
    Model,
    Parameter,
    primary_channel,
    refuse_moved_gaps,
    with_constants,
)
from .flown import located, shortest_period, with_coarse_note


def segment_by_model(
    model: Model,
    recordings: Sequence[Recording],
    parameters: Sequence[Parameter] = (),
    *,
    drive_channel: str | None = None,
    restitution: float = 0.5,
    progress: Callable[[float], None] | None = None,
) -> tuple[Segments, ...]:
    """Segment recordings at every gap of a model's system.

    A gap is computed from the measured components of the state and shifted so that it
    is zero where its rate jumps, as far as the tolerances of the parameters allow.
    If channels that do not saturate also measure the velocities that the rate of change
    of a gap depends on, impacts are jumps of this rate, and contacts are stretches in
    which it is zero. If the system has no gap, each recording is one flight.

    If the velocity of the smooth motion changes within ten milliseconds as much as at
    an impact, impacts are found with the model: a flight is simulated from each
    possible impact to the next, and an impact is rejected if the samples are described
    as well without it. If there are too few samples per oscillation, a note is added to
    the recording's `meta["notes"]`.

    If parameters are given, they are fitted to short pieces of the flights. If the
    model describes most pieces but fails for one, that piece is searched for impacts
    with a lower threshold; if its flight follows a contact, this flight is taken to
    begin at the last sample near the surface.

    Args:
        model: The model. A state component counts as measured if a sensor without a
            bandwidth has its index as `observe`.
        recordings: The recordings.
        parameters: Parameters to fit; their tolerances limit the error of a gap.
        drive_channel: The channel of the drive's encoder (rad), for a model with a
            `Turning` drive.
        restitution: Expected coefficient of restitution, for impacts too weak to be
            observed.
        progress: Called with the fraction of recordings completed.

    Returns:
        The segments of each recording.

    Raises:
        RecordingError: A channel is missing, a gap depends on a state that no channel
            measures, or the samples are too far apart for the model to be followed.
        ValueError: A gap depends on the measured input.

    Examples:
        >>> from jaxcam import fitting, recordings
        >>> from jaxcam.models import BouncingBall
        >>> ball, rng = BouncingBall(), np.random.default_rng(0)
        >>> sensors = {"height_m": fitting.Sensor(0, noise=1e-3)}
        >>> run = recordings.record(ball, sensors, 1.0, rng=rng, state=[1.0, 0.0])
        >>> parts = fitting.segment_by_model(fitting.Model(ball, sensors), [run])
        >>> parts[0].impacts.count
        1
    """
    refuse_moved_gaps(model)
    parameters = tuple(parameters)
    recordings = tuple(recordings)
    measured = tuple(measured_components(model).items())
    picks = {component: name for name, component in reversed(measured)}
    gaps = []
    for recording in sorted(recordings, key=lambda one: -one.interval)[:1]:
        usual = np.nanmedian(measured_states(model, picks, recording), axis=0)
        refuse_slow_samples(with_constants(model, recording), recording, usual)
    for k, recording in enumerate(recordings):
        if progress is not None:
            progress(k / len(recordings))
        gaps.append(_shown_gaps(model, parameters, picks, recording, drive_channel))

    def again(doubted: Sequence[Spans]) -> tuple[Segments, ...]:
        return tuple(
            _segmented(model, recording, shown, restitution, spans)
            for recording, shown, spans in zip(recordings, gaps, doubted)
        )

    found = again([()] * len(recordings))
    # flights of the model have already been searched for missed impacts
    rest = any(
        one.given is None and part.impacts.count for one, part in zip(gaps, found)
    )
    if parameters and rest:
        found = with_missed_impacts(model, parameters, found, again)
    if progress is not None:
        progress(1.0)
    return found


class _ShownGaps(NamedTuple):
    """The gaps that can be computed from the channels, `(g, k)`, their errors `(g,)`
    and names, for each its rate of change `(k,)` if that can be computed too, the
    shortest period of their oscillations (s), and the impacts if only a model can find
    them.
    """

    gaps: Float[np.ndarray, "g k"]
    errors: Float[np.ndarray, " g"]
    names: list[str]
    rates: list[Float[np.ndarray, " k"] | None]
    drive: Drive | None
    period: float
    given: GivenImpacts | None


def _shown_gaps(model, parameters, picks, recording, drive_channel) -> _ShownGaps:
    drive = None if drive_channel is None else read_drive(recording, drive_channel)
    states = measured_states(model, picks, recording)
    here = with_constants(model, recording)
    gaps, slopes, errors, rates, here = measured_gaps(
        here, parameters, recording, states, drive, picks
    )
    shown = np.any(slopes != 0, axis=-1)
    if np.any(shown):
        _refuse_unseen(model, picks, recording, slopes)
    rates = [rate for rate, one in zip(rates, shown) if one]
    period, given = shortest_period(gaps[shown], recording.interval), None
    if len(gaps) and np.all(shown):
        given = located(here, parameters, recording, gaps, errors, drive, period)
    names = [_named(model, int(k)) for k in np.flatnonzero(shown)]
    return _ShownGaps(gaps[shown], errors[shown], names, rates, drive, period, given)


def _named(model: Model, number: int) -> str:
    """Return a gap in words, with the name of its constraint if it has one."""
    names = model.system.constraint_names
    name = f" ({names[number]})" if number < len(names) else ""
    return f"gap {number + 1}{name}"


def _segmented(model, recording, shown: _ShownGaps, restitution, spans) -> Segments:
    primary = primary_channel(model)
    if not len(shown.gaps):
        part = segment(recording, primary)
        return dataclasses.replace(part, drive=shown.drive)
    recording, time = with_coarse_note(recording, shown.period), recording.time
    doubted = [
        (int(np.searchsorted(time, start)), int(np.searchsorted(time, stop)))
        for start, stop in spans
    ]
    return segment_gaps(
        recording,
        primary,
        shown.gaps,
        [float(e) for e in shown.errors],
        drive=shown.drive,
        restitution=restitution,
        doubted=doubted,
        rates=shown.rates,
        given=shown.given,
        names=shown.names,
    )


def _refuse_unseen(model: Model, picks, recording, slopes) -> None:
    """Raise `RecordingError` for a gap that the channels do not determine."""
    names = model.system.state_names
    for number, row in enumerate(slopes):
        for place in np.flatnonzero(row):
            if place in picks:
                continue
            name, sees = f"component {place} of the state", ""
            if names:
                name = f"`{names[place]}`"
                sees = f'`sees = "{names[place]}"` in the rig file, '
            raise RecordingError(
                f"{recording.name}: {_named(model, number)} depends on {name}, which "
                "no channel measures, so impacts cannot be found; measure it, and add "
                f"a channel for it without a bandwidth ({sees}`Sensor({place}, ...)` "
                "in Python)."
            )
