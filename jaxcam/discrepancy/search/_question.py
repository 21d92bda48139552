"""What is asked: recordings, and a rig or any other system with terms inside it."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

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
from ...recordings.files import check_channels, check_drive, unit_of
from ..policy import Policy
from ..terms import base_drive, coordinates, library, SensorTerm, Term, WithTerms


_FOLLOWER = "follower_angle_rad"
# Angles at which the nominal cam is looked up, to check the sign of a recording
_ANGLES = 64

# Share of the speeds of a motion below its fast ones, and that speed (rad/s) of the
# thesis' cam-follower, for which the constants of the forms are stated
_FAST, _THESIS_FAST = 0.95, 2.0

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
    - `drives`: recordings with the channel of a drive whose noise is `drive_noise`.
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
        {"stiffness": stiffness},
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
    references: Mapping[str, float] = {},
) -> Question:
    """The question of any system; terms act on its first coordinate and first gap.

    **Arguments:** `references`: constants of the forms, those that are stated; the
    others follow the speeds of the motion.

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
    plain = Problem.build(Model(system, dict(sensors), drive), recordings, parameters)
    states = np.asarray(plain.start.states)[np.asarray(plain.pieces.exists)]
    size = len(system.state_names) or states.shape[1]
    pairs = coordinates(system, np.median(states, axis=0)[:size])
    unit = unit_of(_channel_of(sensors, pairs[0][0]))
    turned = system.period is not None
    usual = _scaled(states[:, pairs[0][1]])
    constants = dataclasses.replace(usual, **references)
    if candidates is None:
        clocked = turned or drive is not None
        candidates = library(turned, constants, clocked=clocked)
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
        constants,
    )


def _channel_of(sensors: Mapping[str, Sensor], place: int) -> str:
    """The channel that shows a component of the state, or the first one."""
    for name, sensor in sensors.items():
        if isinstance(sensor.observe, int) and sensor.observe == place:
            return name
    return next(iter(sensors))


def _scaled(velocities: Float[np.ndarray, " k"]) -> References:
    """Constants of the forms for a motion at these speeds, about a zero in its middle.

    The speeds within which dry friction changes sign and rises stand to those of the
    motion as they do in the thesis' rig.
    """
    usual = References()
    fast = float(np.quantile(np.abs(velocities), _FAST))
    share = fast / _THESIS_FAST if fast > 0 else 1.0
    return References(
        spring_center=0.0,
        impact_speed=usual.impact_speed * share,
        stribeck_speed=usual.stribeck_speed * share,
        slip_speed=usual.slip_speed * share,
        free_slip_speed=usual.free_slip_speed * share,
    )


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
