"""What is fitted: recordings, and a rig or any other system with terms inside it."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ..fitting import (
    cam_follower_model,
    cam_follower_parameters,
    Input,
    Model,
    Parameter,
    Problem,
)
from ..recordings import Recording, RecordingError, Rig, segment_case, Segments
from ..recordings._check import check_channels, check_drive
from ._drive import ripple_of
from ._term import Term
from ._terms import library
from ._vibration_scan import LEAST
from ._with_terms import base_drive, WithTerms


_FOLLOWER = "follower_angle_rad"


def turns(problem: Problem) -> bool:
    """Whether the phase of a drive means something."""
    return problem.model.system.period is not None


def rig_problem(rig: Rig, recordings, candidates, report):
    runs = tuple(recordings)
    if len(runs) < 2:
        raise RecordingError(
            f"There is {len(runs)} recording; give at least two of the same rig at "
            f"different speeds, so that one can test what the other says."
        )
    _check(rig, [r.recording if isinstance(r, Segments) else r for r in runs])
    report("finding impacts and contacts", None)
    if not all(isinstance(run, Segments) for run in runs):
        runs = segment_case(runs, rig)  # pyright: ignore
    terms = tuple(library() if candidates is None else candidates)
    terms, unlisted = _sorted(terms)
    base = cam_follower_model(rig)
    model = Model(WithTerms(base.system, terms), base.sensors, base_drive())
    parameters = cam_follower_parameters(rig, base=lambda s: s.base)
    names = [p.name for p in parameters]
    report("preparing the fits", None)
    problem = Problem.build(model, runs, parameters + _own(terms, runs))
    report("reading the drive", None)
    ripple = ripple_of([run.recording for run in runs], rig.sensors.cam_floor)
    return problem, names, terms, unlisted, ripple


def system_problem(system, recordings, candidates, sensors, parameters, drive, report):
    if not sensors:
        raise ValueError(
            "Give the sensors of the recordings, such as "
            'sensors={"angle_rad": Sensor(0, noise=1e-4)}.'
        )
    for part in recordings:
        if not isinstance(part, Segments):
            raise ValueError(
                "Cut the recordings first: `jaxcam.recordings.segment(recording, "
                "channel)` for each of them."
            )
    turned = system.period is not None
    if candidates is None:
        candidates = library(turned, 0.0, clocked=turned or drive is not None)
    terms, unlisted = _sorted(tuple(candidates))
    if drive is not None:
        value = drive.value
        drive = Input(drive.channel, lambda s: value(s.base))  # pyright: ignore
    model = Model(WithTerms(system, terms), dict(sensors), drive)
    inside = [_within(parameter) for parameter in parameters]
    report("preparing the fits", None)
    problem = Problem.build(model, recordings, inside + _own(terms, recordings))
    return problem, [p.name for p in inside], terms, unlisted


def _within(parameter: Parameter) -> Parameter:
    """The same parameter of the system that a `WithTerms` holds."""

    def where(model):
        return parameter.where(Model(model.system.base, model.sensors, model.drive))

    return dataclasses.replace(parameter, where=where)


def _sorted(terms: tuple[Term, ...]):
    return (
        tuple(term for term in terms if term.listed),
        tuple(term for term in terms if not term.listed),
    )


def _own(terms, segments) -> list[Parameter]:
    """Parameters of the terms; a frequency is one only with periods in a record."""
    longest = max(part.recording.duration for part in segments)
    found = [p for k, term in enumerate(terms) for p in term.parameters(k)]
    return [
        dataclasses.replace(p, lower=max(p.lower, LEAST / longest))
        if p.unit == "Hz"
        else p
        for p in found
    ]


def _check(rig: Rig, runs: Sequence[Recording]) -> None:
    """Records that cannot be those of the rig.

    **Raises:** `RecordingError` that says what is wrong with which.
    """
    surface = rig.system(1.0)
    angles = np.asarray(surface.contact_angle(np.linspace(0, 2 * np.pi, 64)))
    low, high = float(angles.min()), float(angles.max())
    for run in runs:
        check_channels(run)
        check_drive(run)
        samples = run[_FOLLOWER]
        least = float(np.min(samples))
        # the follower cannot be below the cam, by more than tolerances explain
        room = (high - low) / 2
        if least >= low - room and least <= high:
            continue
        if low - room <= float(np.min(-samples)) <= high:
            raise RecordingError(
                f"{run.name}: `{_FOLLOWER}` has the wrong sign for this rig, whose "
                f"follower is between {low:.3g} and {high:.3g} rad on the cam; "
                f"multiply the column by -1."
            )
        raise RecordingError(
            f"{run.name}: `{_FOLLOWER}` goes down to {least:.3g} rad where the cam of "
            f"this rig is between {low:.3g} and {high:.3g} rad; check that the column "
            f"and the rig file belong to this record, and that it is in radians."
        )
