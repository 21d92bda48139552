"""Form the question of a diagnosis for an arbitrary system or its setup."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...fitting import Input, Model, Parameter, Problem, Sensor, Setup, Turning
from ...fitting.engine import moves_surface
from ...hybrid import HybridSystem
from ...recordings import Recording, References
from ...recordings.cut import (
    fast_speed,
    measured_noise,
    Segments,
    usual_acceleration,
)
from ...recordings.files import check_channels, unit_of
from ..policy import Policy
from ..terms import (
    coordinates,
    fitted_faults,
    library,
    Location,
    SensorTerm,
    system_with_terms,
    Term,
    terms_of,
    watched,
)
from ._motion_scales import motion_scales
from ._of_base import channel_of, measured_in, of_base, usual_state, within
from ._own_values import with_own_values
from ._question import (
    by_listing,
    Candidates,
    check_runs,
    Question,
    Report,
    term_parameters,
    with_seen_noise,
)


# Slip speed as a fraction of the typical change of speed per step, so that the impulse
# of dry friction is integrated accurately enough
_RESOLVED = 0.3


def segmented(
    setup: Setup,
    recordings: Sequence[Recording | Segments],
    report: Report,
    lags: Mapping[str, float],
) -> tuple[Setup, tuple[Segments, ...]]:
    """Return the segments of recordings, without long lags, and their setup; `lags` (s)
    of channels replace those of their sensors. Existing segments are kept.

    **Raises:** `RecordingError` if the recordings cannot be those of the rig.
    """
    runs = tuple(recordings)
    check_runs(runs)
    for run in runs:
        check_channels(run.recording if isinstance(run, Segments) else run)
    report("finding impacts and contacts", None)
    setup, runs = setup.without_lags(runs, lags)
    return setup, setup.segments(runs)


def setup_question(
    setup: Setup,
    segments: Sequence[Segments],
    candidates: Candidates,
    report: Report,
    policy: Policy,
    location: Location = Location(),
) -> Question:
    """Return the question of a diagnosis for an arbitrary system, given by a setup with
    its sensors and tolerances.
    """
    model = setup.model
    question = system_question(
        model.system,
        segments,
        candidates,
        model.sensors,
        setup.parameters,
        model.drive,
        report,
        policy,
        setup.references,
        setup.drive_channel,
        location,
    )
    doubted = setup.contact_in_doubt(segments)
    return dataclasses.replace(question, doubted=doubted)


def system_question(
    system: HybridSystem,
    recordings: Sequence[Segments],
    candidates: Candidates,
    sensors: Mapping[str, Sensor] | None,
    parameters: Sequence[Parameter],
    drive: Turning | Input | None,
    report: Report,
    policy: Policy,
    stated: Mapping[str, float] | None = None,
    drive_channel: str | None = None,
    location: Location = Location(),
) -> Question:
    """Return the question of a diagnosis for an arbitrary system; terms of the library
    act on the coordinate and the gap of a `location`.

    **Arguments:** as for `diagnose`, and three more. `stated` gives constants of the
    terms by name. `drive_channel` is the channel of a rotating drive, which is searched
    for ripple. `location` is the place at which missing physics is sought.

    **Raises:** `ValueError` if a recording is not segmented or no sensors are given.
    """
    if not sensors:
        raise ValueError(
            "Give the sensors of the recordings, such as "
            'sensors={"angle_rad": Sensor(0, noise=1e-4)}.'
        )
    for part in recordings:
        if not isinstance(part, Segments):
            raise ValueError(
                "Segment the recordings first: call "
                "`jaxcam.recordings.segment(recording, channel)` for each one."
            )
    runs = [part.recording for part in recordings]
    sensors, noisier = with_seen_noise(sensors, runs, policy)
    state = usual_state(system, sensors, runs)
    pairs = location.first(coordinates(system, state))
    seen = channel_of(sensors, pairs[0][0])
    # the stated constants of a rig apply only to its first coordinate
    stated = {} if location.coordinate else stated
    unit, turned = unit_of(seen), system.period is not None
    usual = References.of_speed(fast_speed(runs, seen))
    references = dataclasses.replace(usual, **(stated or {}))
    profiled = turned and moves_surface(system, state)
    # errors of the sensor that the rig fits itself are no missing effects
    taken = fitted_faults(Model(system, dict(sensors), drive), seen, parameters)

    def listed(references: References):
        if candidates is None or isinstance(candidates, str):
            extended = candidates is not None
            clocked = turned or drive is not None
            usual = library(turned, references, clocked, extended, profiled)
            offered = [location.of_library(term) for term in _others(usual, taken)]
        else:
            offered = [location.reordered(term, len(pairs)) for term in candidates]
        scales = motion_scales(runs, seen, sensors[seen], references.slip_speed)
        return by_listing(measured_in(unit, [term.scaled(scales) for term in offered]))

    terms, unlisted = listed(references)
    whole = system_with_terms(system, terms, pairs, state)
    model = watched(Model(whole, dict(sensors), of_base(drive)))
    inside = [within(parameter) for parameter in parameters]
    rig = tuple(one.name for one in inside)
    report("preparing the fits", None)
    problem = Problem.build(
        model, recordings, inside + term_parameters(terms, recordings, policy)
    )
    slip = _resolved_slip(problem, seen)
    if "slip_speed" not in (stated or {}) and 0 < slip < references.slip_speed:
        references = references.sharper(slip / references.slip_speed)
        terms, unlisted = listed(references)
        problem = _with_terms(problem, terms)
    problem = with_own_values(problem, rig)

    def relisted(question: Question, references: References) -> Question:
        terms, unlisted = listed(references)
        return dataclasses.replace(
            question,
            problem=_with_terms(question.problem, terms),
            terms=terms,
            unlisted=unlisted,
            references=references,
        )

    # given terms have the constants that they were given
    free = candidates is None or isinstance(candidates, str)
    return Question(
        problem=problem,
        rig=rig,
        terms=terms,
        unlisted=unlisted,
        turned=turned,
        unit=unit,
        references=references,
        noisier=noisier,
        location=location,
        unstated=tuple({"impact_speed"} - {*(stated or {})}) if free else (),
        relisted=relisted,
        **_drives(recordings, drive_channel),
    )


def _others(terms: Sequence[Term], taken: set[str]) -> list[Term]:
    """Return the terms that do not act on the `taken` fields of a sensor."""
    return [
        term
        for term in terms
        if not (isinstance(term, SensorTerm) and taken & set(term.fields))
    ]


def _drives(recordings: Sequence[Segments], channel: str | None) -> dict[str, Any]:
    """Return the fields of a `Question` that hold the recordings of a drive and the
    noise of its encoder.
    """
    if channel is None:
        return {}
    runs = tuple(part.recording for part in recordings)
    noise = float(np.median([measured_noise(run[channel]) for run in runs]))
    return {"drives": runs, "drive_noise": noise, "drive_channel": channel}


def _resolved_slip(problem: Problem, channel: str) -> float:
    """Return the smallest slip speed that the steps of a flight resolve.

    A smoothed friction force changes sign over a velocity range of the order of the
    slip speed, so it is too small while the body comes to rest. The slip speed is
    therefore set as low as the steps allow.
    """
    pieces = problem.pieces
    step = float(np.median(np.asarray(pieces.flown.step)[np.asarray(pieces.exists)]))
    runs = [part.recording for part in problem.segments]
    return _RESOLVED * step * usual_acceleration(runs, channel)


def _with_terms(problem: Problem, terms: Sequence[Term]) -> Problem:
    """Return the same problem with other constants in its terms."""

    def put(model: Model) -> Model:
        fresh = jax.tree.map(jnp.asarray, tuple(terms))
        return eqx.tree_at(terms_of, model, fresh)

    layout = problem.layout
    return dataclasses.replace(
        problem,
        model=put(problem.model),
        layout=eqx.tree_at(lambda part: part.model, layout, put(layout.model)),
    )
