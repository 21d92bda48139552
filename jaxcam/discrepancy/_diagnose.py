"""From recordings to a verdict: effect, none or unknown."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from ..fitting import (
    cam_follower_model,
    cam_follower_parameters,
    Input,
    Model,
    Parameter,
    Problem,
    Sensor,
)
from ..hybrid import HybridSystem
from ..recordings import Recording, RecordingError, Rig, segment_case, Segments
from ..recordings._check import check_channels, check_drive
from ._diagnosis import Diagnosis, Effect, Value
from ._drive import Ripple, ripple_of
from ._engine import value_of
from ._evidence import held_out, limits, redrawn, sure
from ._kept_trials import KeptTrials
from ._search import FALSE_ALARMS, Search, Trial
from ._structure import Structure, structures
from ._term import Term, terms_of
from ._terms import DriveRipple, library
from ._vibration_scan import LEAST
from ._with_terms import base_drive, WithTerms
from ._words import listed, summary_of


# What is left over is part of a named effect where it is less than this part of it: a
# force that is 15 % off leaves the square of that in the likelihood
_SHARE = 0.15**2
# Subsets within this BIC of the best one are as good
_TIE = 10.0
_FOLLOWER = "follower_angle_rad"


def diagnose(
    system: HybridSystem | Rig,
    recordings: Sequence[Recording | Segments],
    candidates: Sequence[Term] | None = None,
    *,
    sensors: Mapping[str, Sensor] | None = None,
    parameters: Sequence[Parameter] = (),
    drive: Input | None = None,
    case: str = "",
    seed: int = 0,
    progress: Callable[[str, float | None], None] | None = None,
    keep: Path | None = None,
) -> Diagnosis:
    """What physics a model leaves out, from recordings of the real thing.

    **Arguments:**

    - `system`: a `Rig` from `jaxcam.recordings.read_rig`, which knows its sensors and
        tolerances; or any system with one coordinate, with what follows.
    - `recordings`: at least two of a rig; of another system, what
        `jaxcam.recordings.segment` makes of them.
    - `candidates`: terms that may be named; by default `library()`. Those that are not
        `listed` only help to describe what is unknown.
    - `sensors`, `parameters`, `drive`: as for `jaxcam.fitting.Model` and `Problem`, of
        a system that is not a rig; the drive is an input that was measured.
    - `seed`: of the redrawn blocks.
    - `progress`: called with a sentence and a fraction, or `None`.
    - `keep`: a folder in which fits are kept until the diagnosis is done; one that was
        interrupted goes on from there.

    **Raises:** `RecordingError` for recordings from which nothing can be told, with one
    sentence that says why.
    """
    report = progress or (lambda sentence, fraction: None)
    recordings = tuple(recordings)
    if isinstance(system, Rig):
        problem, rig, terms, unlisted, ripple = _of_rig(
            system, recordings, candidates, report
        )
    else:
        problem, rig, terms, unlisted = _of_system(
            system, recordings, candidates, sensors, parameters, drive, report
        )
        ripple = None
    turned = isinstance(system, Rig) or system_turns(problem)
    kept = None if keep is None else KeptTrials(keep, problem)
    search = Search(problem, rig, terms, report, kept)
    best = search.run()
    report("redrawing stretches of the records", None)
    found = best
    best, inclusion, deviation, doubtful = sure(search, found, seed)
    before = search.trials[frozenset()]
    report("looking at what is left over", None)

    def left(trial: Trial) -> list[Structure]:
        response, scan = search.response(trial.names), search.scan(trial.names)
        return structures(trial.fit, response, unlisted, scan, turned)

    left_before = left(before)
    left_after = left(best) if best.names else left_before
    if doubtful and any(one.significant for one in left_after):
        # that something is there is sure; what explains all of it is what it is
        with_all = left(found)
        if not any(one.significant for one in with_all):
            best, left_after, doubtful = found, with_all, []
            inclusion, deviation = redrawn(search, best, seed)
    rms_before, rms_after, gained, unseen = held_out(search, before, best, report)
    effects = [
        _effect(search, best, before, name, inclusion, deviation, gained)
        for name in sorted(best.names)
    ]
    if ripple is not None and _ripples(ripple, len(terms) + 1):
        effects.append(_drive_effect(ripple))
    unexplained = [one for one in left_after if one.significant]
    verdict, caveats = _verdict(effects, unexplained, before, best)
    caveats += [
        f"A term for {name.replace('_', ' ')} gains something, but in {part:.0%} of "
        f"the redrawn sets of stretches only; record more before you believe it."
        for name, part in doubtful
    ]
    if verdict == "unknown":
        effects.insert(0, _unknown(unexplained, problem, gained))
    alternatives = _alternatives(search, best)
    for name, delta in alternatives:
        if delta < _TIE:
            caveats.append(
                f"These records cannot tell {listed(sorted(best.names))} from "
                f"{name.replace('_', ' ')}: the BIC differs by {delta:.1f} only. "
                f"Record larger and smaller bounces, and speeds further apart."
            )
    caveats += [
        f"Something that differs from record to record is left over ({one.sentence}): "
        f"it is no physics that they share; look at how they were recorded."
        for one in left_after
        if one.gain > one.asked and one.foretold <= 0
    ][:1]
    if kept is not None:
        kept.clear()
    floor = float(next(iter(problem.model.sensors.values())).floor)
    least = limits(search, best)
    units = {one.name: one.unit for t in terms for one in t.strengths()}
    names = [effect.name for effect in effects]
    return Diagnosis(
        case,
        verdict,
        tuple(effects),
        tuple(alternatives),
        rms_before * floor,
        rms_after * floor,
        floor,
        _unit(next(iter(problem.model.sensors))),
        _rig_values(system, best, deviation),
        summary_of(
            verdict, effects, unexplained, best, before, rig, least, units, rms_after
        ),
        before.fit,
        best.fit,
        tuple(left_before),
        tuple(left_after),
        unseen,
        ripple,
        _pulls(search, before, best),
        {
            name: Value(size, stderr, units[name])
            for name, (size, stderr, _) in least.items()
            if name not in names
        },
        {name: hidden for name, (_, _, hidden) in least.items()},
        tuple(caveats),
    )


def _unit(channel: str) -> str:
    """The unit that ends the name of a channel, as in `height_m`."""
    for unit, written in (("_rad_s", "rad/s"), ("_rad", "rad"), ("_m", "m")):
        if channel.endswith(unit):
            return written
    return ""


def system_turns(problem: Problem) -> bool:
    """Whether the phase of a drive means something."""
    return problem.model.system.period is not None


def _of_rig(rig: Rig, recordings, candidates, report):
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


def _of_system(system, recordings, candidates, sensors, parameters, drive, report):
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


def _ripples(ripple: Ripple, tests: int) -> bool:
    asked = max(2 * math.log(ripple.count), chi2.isf(FALSE_ALARMS / tests, 2))
    return bool(ripple.gain > asked)


def _effect(
    search: Search, best: Trial, before: Trial, name, inclusion, deviation, gained
) -> Effect:
    term = search.term(name)
    less = search.trials.get(best.names - {name}, before)
    parameters = {
        one.name: Value(
            best.fit[one.name].value,
            max(best.fit[one.name].stderr, deviation.get(one.name, 0.0)),
            one.unit,
        )
        for one in term.strengths()
    }
    if name == "external_vibration":
        parameters = _polar(parameters)
    records = _seen_in(search, best, [one.name for one in term.strengths()])
    alone = sum(gained.values())
    return Effect(
        name,
        term.sentence,
        parameters,
        term.where,
        term.region,
        records,
        best.bic - less.bic,
        alone,
        inclusion[name],
    )


def _polar(parts: dict[str, Value]) -> dict[str, Value]:
    a, b, fe = parts["ext_sin"], parts["ext_cos"], parts["fe"]
    size = math.hypot(a.value, b.value)
    error = math.hypot(a.value * a.stderr, b.value * b.stderr) / size
    phase = math.hypot(a.value * b.stderr, b.value * a.stderr) / size**2
    return {
        "ext": Value(size, error, "rad/s^2"),
        "fe": fe,
        "phase": Value(math.atan2(b.value, a.value), phase, "rad"),
    }


def _seen_in(search: Search, best: Trial, names) -> tuple[str, ...]:
    """Records in which the effect is larger than three of their own errors."""
    blocks = search.blocks(best)
    rows = blocks.rows(names)
    found = []
    for k, record in enumerate(blocks.record):
        value = np.array([value_of(best.fit, blocks.names[r]) for r in rows])
        value = value / blocks.scale[rows]
        inside = blocks.information[k][np.ix_(rows, rows)]
        if value @ inside @ value > chi2.isf(1e-3, len(rows)):
            found.append(record)
    return tuple(found)


def _drive_effect(ripple: Ripple) -> Effect:
    term = DriveRipple()
    seen = tuple(
        name for name, (eps, error) in ripple.per_record.items() if eps > 3 * error
    )
    return Effect(
        term.name,
        term.sentence,
        {
            "eps": Value(ripple.eps, ripple.eps_stderr, "-"),
            "psi": Value(ripple.psi, ripple.psi_stderr, "rad"),
        },
        term.where,
        term.region,
        seen,
        ripple.delta_bic,
        ripple.heldout_gain,
        ripple.inclusion,
    )


def _verdict(effects, unexplained: list[Structure], before: Trial, best: Trial):
    caveats = []
    if not unexplained:
        return ("effect" if effects else "none"), caveats
    left = max(one.gain for one in unexplained)
    explained = before.fit.cost - best.fit.cost
    if best.names and left < _SHARE * explained:
        caveats.append(
            f"Something small is left over ({unexplained[0].sentence}, "
            f"{unexplained[0].place}): {left / explained:.1%} of what was explained. "
            f"The effect may have a slightly different form."
        )
        return "effect", caveats
    return "unknown", caveats


def _unknown(unexplained: list[Structure], problem: Problem, gained) -> Effect:
    first = unexplained[0]
    return Effect(
        "unknown",
        first.sentence,
        {},
        first.where,
        first.place,
        problem.records,
        -first.gain + first.count * math.log(problem.samples),
        sum(gained.values()),
        1.0,
    )


def _alternatives(search: Search, best: Trial) -> list[tuple[str, float]]:
    found = [
        ("+".join(sorted(names)) or "none", trial.bic - best.bic)
        for names, trial in search.trials.items()
        # a superset is the same explanation with more
        if names != best.names and not names > best.names
    ]
    return sorted(found, key=lambda one: one[1])[:8]


def _rig_values(system, best: Trial, deviation) -> dict[str, Value]:
    found = {}
    for one in best.fit.estimates:
        if one.name not in search_names(best):
            continue
        stderr = max(one.stderr, deviation.get(one.name, 0.0))
        value, unit = one.value, one.unit
        name = one.name
        if isinstance(system, Rig) and name == "stiffness":
            inertia = system.inertia.value
            name, value, stderr = "K/J", value / inertia, stderr / inertia
            unit = "1/(m^2 s^2)"
        found[name] = Value(value, stderr, unit)
    return found


def search_names(best: Trial) -> set[str]:
    """Parameters of the rig among those of a fit."""
    problem = best.fit.problem
    terms = terms_of(problem.model)
    own = {one.name for term in terms for one in term.strengths()}
    return set(best.fit.free) - own


def _pulls(search: Search, before: Trial, best: Trial):
    found = {}
    for name in search.rig:
        parameter = search.problem.parameter(name)
        place = search.problem.names.index(name)
        nominal = float(search.problem.start.values[0, place])
        size = parameter.size(nominal)
        found[name] = (
            (before.fit[name].value - nominal) / size,
            (best.fit[name].value - nominal) / size,
        )
    return found
