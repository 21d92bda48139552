"""What is asked: recordings, and a rig or any other system with terms inside it."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fitting import (
    cam_follower_model,
    cam_follower_parameters,
    Input,
    Model,
    Parameter,
    Problem,
    Sensor,
    Setup,
    Turning,
)
from ...hybrid import HybridSystem
from ...recordings import (
    Recording,
    RecordingError,
    References,
    Rig,
    segment_case,
    Segments,
)
from ...recordings.against_model import size_of
from ...recordings.cut import measured_noise
from ...recordings.files import check_channels, check_drive, unit_of
from ..policy import Policy
from ..terms import base_drive, coordinates, library, SensorTerm, Term, WithTerms


_FOLLOWER = "follower_angle_rad"
# Angles at which the nominal cam is looked up, to check the sign of a recording
_ANGLES = 64

# Share of the speeds of a motion below its fast ones, and that speed (rad/s) of the
# thesis' cam-follower, for which the constants of the forms are stated; time (s) over
# which a speed is measured
_FAST, _THESIS_FAST, _STRIDE = 0.95, 2.0, 5e-3

Report = Callable[[str, float | None], None]


class Shown(NamedTuple):
    """How a fitted parameter is reported: divided by something, with another name."""

    name: str
    divisor: float
    unit: str


@dataclasses.dataclass(frozen=True)
class Question:
    """A problem whose system holds the terms, and what a report needs of the system.

    - `rig`: names of the system's own parameters.
    - `terms`: those that may be named; `unlisted` only describe what is unknown.
    - `turned`: whether there is a drive with a phase.
    - `unit`: of the motion. `references`: constants of the forms of shapes.
    - `drives`: recordings of a drive in the channel `drive_channel`, whose noise is
        `drive_noise`.
    - `shown`: parameters that are reported in another way.
    """

    problem: Problem
    rig: tuple[str, ...]
    terms: tuple[Term, ...]
    unlisted: tuple[Term, ...]
    turned: bool
    unit: str
    references: References
    drives: tuple[Recording, ...] = ()
    drive_noise: float = math.nan
    drive_channel: str = "cam_angle_rad"
    shown: Mapping[str, Shown] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class _OfBase:
    """What picks a field out of the system that a `WithTerms` holds.

    Equal for equal picks, so that diagnoses of one rig share compiled programs.
    """

    pick: Callable

    def __call__(self, system):
        return self.pick(system.base)


def rig_question(
    rig: Rig,
    recordings: Sequence[Recording | Segments],
    candidates: Sequence[Term] | None,
    report: Report,
    policy: Policy,
) -> Question:
    """The question of a cam-follower rig, which states its sensors and tolerances.

    **Raises:** `RecordingError` for recordings that cannot be those of the rig.
    """
    runs = tuple(recordings)
    _refuse_one(runs)
    _check(rig, [r.recording if isinstance(r, Segments) else r for r in runs])
    report("finding impacts and contacts", None)
    cut = [run for run in runs if isinstance(run, Segments)]
    if len(cut) < len(runs):
        cut = list(segment_case(runs, rig))  # pyright: ignore
    if candidates is None:
        candidates = library(references=rig.references)
    terms, unlisted = _sorted(tuple(candidates))
    base = cam_follower_model(rig)
    model = Model(WithTerms(base.system, terms), base.sensors, base_drive())
    parameters = cam_follower_parameters(rig, base=lambda s: s.base)
    names = tuple(p.name for p in parameters)
    report("preparing the fits", None)
    problem = Problem.build(model, cut, parameters + _own(terms, cut, policy))
    # the recordings tell only the ratio of stiffness and inertia
    stiffness = Shown("K/J", rig.inertia.value, "1/(m^2 s^2)")
    return Question(
        problem,
        names,
        terms,
        unlisted,
        True,
        "rad",
        rig.references,
        tuple(run.recording for run in cut),
        rig.sensors.cam_floor,
        shown={"stiffness": stiffness},
    )


def setup_question(
    setup: Setup,
    recordings: Sequence[Recording | Segments],
    candidates: Sequence[Term] | None,
    report: Report,
    policy: Policy,
) -> Question:
    """The question of a rig of any system, which states its sensors and tolerances.

    **Raises:** `RecordingError` for recordings that cannot be those of the rig.
    """
    runs = tuple(recordings)
    _refuse_one(runs)
    for run in runs:
        check_channels(run.recording if isinstance(run, Segments) else run)
    report("finding impacts and contacts", None)
    model = setup.model
    return system_question(
        model.system,
        setup.segments(runs),
        candidates,
        model.sensors,
        setup.parameters,
        model.drive,
        report,
        policy,
        setup.references,
        setup.drive_channel,
    )


def system_question(
    system: HybridSystem,
    recordings: Sequence[Segments],
    candidates: Sequence[Term] | None,
    sensors: Mapping[str, Sensor] | None,
    parameters: Sequence[Parameter],
    drive: Turning | Input | None,
    report: Report,
    policy: Policy,
    stated: Mapping[str, float] | None = None,
    drive_channel: str | None = None,
) -> Question:
    """The question of any system; terms act on its first coordinate and first gap.

    **Arguments:** as for `diagnose`; `stated` constants of the forms, by name; the
    channel of a turning drive, to look for a ripple in it.

    **Raises:** `ValueError` for recordings that are not cut, or without sensors.
    """
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
    pairs = coordinates(system, _usual_state(system, sensors, recordings))
    seen = _channel_of(sensors, pairs[0][0])
    unit, turned = unit_of(seen), system.period is not None
    references = _scaled(recordings, seen, stated or {})
    if candidates is None:
        clocked = turned or drive is not None
        candidates = library(turned, references, clocked=clocked)
    terms, unlisted = _sorted(_measured_in(unit, candidates))
    if isinstance(drive, Input):
        drive = Input(drive.channel, _OfBase(drive.value))
    elif drive is not None:
        drive = Turning(_OfBase(drive.speed), _OfBase(drive.phase))
    model = Model(WithTerms(system, terms, pairs), dict(sensors), drive)
    inside = [_within(parameter) for parameter in parameters]
    report("preparing the fits", None)
    problem = Problem.build(model, recordings, inside + _own(terms, recordings, policy))
    return Question(
        problem,
        tuple(p.name for p in inside),
        terms,
        unlisted,
        turned,
        unit,
        references,
        **_drives(recordings, drive_channel),
    )


def _drives(recordings: Sequence[Segments], channel: str | None) -> dict[str, Any]:
    """What is asked of a drive, with the noise that its encoder shows."""
    if channel is None:
        return {}
    runs = tuple(part.recording for part in recordings)
    noise = float(np.median([measured_noise(run[channel]) for run in runs]))
    return {"drives": runs, "drive_noise": noise, "drive_channel": channel}


def _channel_of(sensors: Mapping[str, Sensor], place: int) -> str:
    """The channel that shows a component of the state, or the first one."""
    for name, sensor in sensors.items():
        if isinstance(sensor.observe, int) and sensor.observe == place:
            return name
    return next(iter(sensors))


def _usual_state(system, sensors, recordings) -> Float[np.ndarray, " n"]:
    """The middle of what is measured of a state, zero for what is not."""
    picks = {name: sensor.observe for name, sensor in sensors.items()}
    state = np.zeros(size_of(system, picks))
    for name, pick in picks.items():
        if isinstance(pick, int):
            samples = np.concatenate([part.recording[name] for part in recordings])
            state[pick] = np.nanmedian(samples)
    return state


def _scaled(
    recordings: Sequence[Segments], channel: str, stated: Mapping[str, float]
) -> References:
    """Constants of the forms for a motion; those that are not stated, by its speeds.

    The speeds within which dry friction changes sign and rises stand to those of the
    motion as they do in the thesis' rig.
    """
    speeds = []
    for part in recordings:
        time, samples = part.recording.time, part.recording[channel]
        # over so many samples noise is no speed
        stride = max(1, round(_STRIDE / part.recording.interval))
        time, samples = time[::stride], samples[::stride]
        speeds.append(np.abs(np.diff(samples) / np.diff(time)))
    every = np.concatenate(speeds)
    fast = float(np.quantile(every[np.isfinite(every)], _FAST))
    usual, share = References(), fast / _THESIS_FAST if fast > 0 else 1.0
    scaled = {
        name: getattr(usual, name) * share
        for name in ("impact_speed", "stribeck_speed", "slip_speed", "free_slip_speed")
    }
    return dataclasses.replace(usual, **{"spring_center": 0.0, **scaled, **stated})


def _measured_in(unit: str, terms: Sequence[Term]) -> tuple[Term, ...]:
    """The terms with the unit of the coordinate in their own."""
    return tuple(dataclasses.replace(term, motion_unit=unit or "1") for term in terms)


def _refuse_one(runs: Sequence[Recording | Segments]) -> None:
    if len(runs) < 2:
        raise RecordingError(
            f"There is {len(runs)} recording; give at least two of the same rig at "
            f"different speeds, so that one can test what the other says."
        )


def _within(parameter: Parameter) -> Parameter:
    """The same parameter of the system that a `WithTerms` holds."""

    def where(model):
        return parameter.where(Model(model.system.base, model.sensors, model.drive))

    return dataclasses.replace(parameter, where=where)


def _sorted(terms: tuple[Term, ...]):
    """Terms that may be named, and those that only describe."""
    for term in terms:
        if term.strengths() and not term.acts and not isinstance(term, SensorTerm):
            raise ValueError(
                f"The term {term.name!r} acts nowhere; override its `acceleration`, "
                f"`contact` or `restitution`, or make it a `SensorTerm`."
            )
    return (
        tuple(term for term in terms if term.listed),
        tuple(term for term in terms if not term.listed),
    )


def _own(terms: Sequence[Term], segments, policy: Policy) -> list[Parameter]:
    """Parameters of the terms; a frequency is one only with periods in a record."""
    longest = max(part.recording.duration for part in segments)
    least = policy.fewest_periods / longest
    found = []
    for k, term in enumerate(terms):
        inner = {one.name for one in term.strengths() if one.inner}
        found += [
            dataclasses.replace(p, lower=max(p.lower, least)) if p.name in inner else p
            for p in term.parameters(k)
        ]
    return found


def _check(rig: Rig, runs: Sequence[Recording]) -> None:
    """Records that cannot be those of the rig.

    **Raises:** `RecordingError` that says what is wrong with which.
    """
    surface = rig.system(1.0)
    angles = np.asarray(surface.contact_angle(np.linspace(0, 2 * np.pi, _ANGLES)))
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
