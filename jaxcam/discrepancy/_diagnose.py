"""Diagnose recordings: the verdict is "effect", "none" or "unknown"."""

import dataclasses
import math
import shutil
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from ..fitting import Fit, Input, Parameter, Sensor, Setup, Turning
from ..hybrid import HybridSystem
from ..recordings import Recording, Rig, Segments
from ._elsewhere import falls_short, sought_elsewhere
from ._lagging import long_lag, more_accurate
from ._mappings import make_room
from ._set_aside import elsewhere, odd_record, set_aside
from .evidence import Choice, choose, ripple_of, whole_flights
from .policy import Policy
from .report import Diagnosis, diagnosis_of
from .search import (
    Candidates,
    Clock,
    KeptTrials,
    Missing,
    model_errors_dominate,
    Question,
    Report,
    rig_question,
    Search,
    segmented,
    setup_question,
    starting_at,
    system_question,
    Trial,
    Trials,
    with_fitted_speed,
    with_model_error,
)
from .terms import Location


def diagnose(
    system: HybridSystem | Rig | Setup,
    recordings: Sequence[Recording | Segments],
    candidates: Candidates = None,
    *,
    sensors: Mapping[str, Sensor] | None = None,
    parameters: Sequence[Parameter] = (),
    drive: Turning | Input | None = None,
    case: str = "",
    seed: int = 0,
    progress: Callable[[str, float | None], None] | None = None,
    keep: Path | None = None,
    policy: Policy = Policy(),
) -> Diagnosis:
    """Determine from recordings what physics a model lacks.

    A diagnosis takes minutes; [Model discrepancy](../discrepancy.md) shows examples.
    Terms of the library and unknown forces are sought at the first coordinate and the
    first gap, and unknown functions that act at impacts are sought at the first two
    gaps. Other coordinates and gaps are tried only if a residual above the noise
    remains; each such additional search takes as long again.

    Args:
        system: A `Rig` from `jaxcam.recordings.read_rig` or a `Setup` from
            `jaxcam.fitting.read_setup`, each with sensors and tolerances; or a
            bare system: any system with at least one coordinate, together with
            `sensors`, `parameters` and `drive`.
        recordings: At least two recordings of a rig; for a bare system, segments from
            `jaxcam.recordings.segment`.
        candidates: Terms that may be named; default: `library()`, with the constants of
            the rig; `"extended"`: the same with `library(extended=True)`. Terms with
            `listed=False` only help to describe an unknown effect.
        sensors: For a bare system, as for `jaxcam.fitting.Model`.
        parameters: For a bare system, as for `jaxcam.fitting.Problem`.
        drive: For a bare system, its measured drive or input.
        case: Name of the case.
        seed: Seed of the block bootstrap.
        progress: Called with a sentence and the completed fraction (or `None`).
        keep: Folder in which fits are stored until the diagnosis is complete; an
            interrupted diagnosis continues from there.
        policy: Settings that determine the verdict and limit the search time.

    Returns:
        A [`jaxcam.discrepancy.Diagnosis`][].

    Raises:
        RecordingError: The recordings are insufficient; the message gives the reason.
        ValueError: A term overrides none of the methods through which it can act; or
            `candidates` is an unknown word.
    """
    if isinstance(candidates, str) and candidates != "extended":
        raise ValueError(f'`candidates` is "{candidates}"; give terms, or "extended".')
    conditions = _Conditions(
        case,
        seed,
        progress or (lambda sentence, fraction: None),
        policy,
        Clock(policy.minutes),
    )
    rig = _Rig(system, candidates, sensors, parameters, drive)
    make_room()

    def asked(
        runs: Sequence[Recording | Segments],
        folder: Path | None,
        location: Location = Location(),
        lags: Mapping[str, float] = MappingProxyType({}),
        before: _Answer | None = None,
    ) -> _Answer:
        question = rig.question(runs, location, lags, conditions)
        return _answered(question, folder, conditions, before)

    def asked_at(location: Location) -> Diagnosis:
        kind, k = ("coordinate", 0) if location.coordinate else ("gap", 1)
        conditions.report(f"searching at {kind} {location[k] + 1}", None)
        folder = keep and keep / "at_{}_{}".format(*location)
        return asked(recordings, folder, location, lags).diagnosis

    first = asked(recordings, keep)
    lags = long_lag(first.diagnosis, recordings)
    if lags:
        conditions.report("repeating the diagnosis without the lag", None)
        folder = None if keep is None else keep / "without_lag"
        again = asked(recordings, folder, lags=lags, before=first.named)
        better = more_accurate(again.diagnosis, first.diagnosis)
        first, lags = (again, lags) if better else (first, {})
    found = first.diagnosis
    odd = odd_record(found.after, policy)
    if odd is not None:
        conditions.report(f"repeating the diagnosis without {odd}", None)
        others = [run for run in recordings if _name_of(run) != odd]
        folder = None if keep is None else keep / "without_one"
        again = asked(others, folder, lags=lags, before=first)
        found = set_aside(found, again.diagnosis, odd)
    elif falls_short(found):
        found = sought_elsewhere(found, asked_at, candidates in (None, "extended"))
    if keep is not None and not conditions.clock.stopped:
        # with more time, an interrupted search may continue from its fits
        shutil.rmtree(keep, ignore_errors=True)
    return found


def _name_of(run: Recording | Segments) -> str:
    return run.recording.name if isinstance(run, Segments) else run.name


class _Conditions(NamedTuple):
    """What all searches of a diagnosis have in common."""

    case: str
    seed: int
    report: Report
    policy: Policy
    clock: Clock

    def trials(self, question: Question, keep: Path | None) -> Trials:
        """Return the fits of a question; those in a folder are kept."""
        problem, rig, terms = question.problem, question.rig, question.terms
        kept = None if keep is None else KeptTrials(keep, problem, self.policy)
        return Trials(problem, rig, terms, self.policy, self.report, kept, self.clock)


@dataclasses.dataclass(frozen=True)
class _Rig:
    """A rig, a setup or a bare system, with the terms that may be named."""

    system: HybridSystem | Rig | Setup
    candidates: Candidates
    # of a bare system
    sensors: Mapping[str, Sensor] | None
    parameters: Sequence[Parameter]
    drive: Turning | Input | None
    # segments that were found, which do not depend on the location, by recordings (all
    # of which exist as long as the diagnosis) and lags
    _cut: dict[Hashable, tuple[Setup, tuple[Segments, ...]]] = dataclasses.field(
        default_factory=dict
    )

    def _segmented(
        self,
        setup: Setup,
        recordings: Sequence[Recording | Segments],
        lags: Mapping[str, float],
        report: Report,
    ) -> tuple[Setup, tuple[Segments, ...]]:
        key = tuple(map(id, recordings)), tuple(lags.items())
        if key not in self._cut:
            self._cut[key] = segmented(setup, recordings, report, lags)
        return self._cut[key]

    def question(
        self,
        recordings: Sequence[Recording | Segments],
        location: Location,
        lags: Mapping[str, float],
        conditions: _Conditions,
    ) -> Question:
        """Return the question to be answered from recordings; `lags` (s) of channels
        replace those of their sensors.
        """
        system, asked = self.system, (conditions.report, conditions.policy)
        offered = recordings, self.candidates
        if isinstance(system, Rig):
            return rig_question(system, *offered, *asked, lags)
        if isinstance(system, Setup):
            parts = self._segmented(system, recordings, lags, conditions.report)
            return setup_question(*parts, self.candidates, *asked, location)
        return system_question(
            system,
            tuple(recordings),  # pyright: ignore
            self.candidates,
            self.sensors,
            self.parameters,
            self.drive,
            *asked,
            location=location,
        )


class _Answer(NamedTuple):
    """A diagnosis, and the fits with functions, the best first, from which a further
    search in the same recordings, or in some of them, may start.
    """

    diagnosis: Diagnosis
    functions: tuple[Missing, ...] = ()

    @property
    def named(self) -> "_Answer":
        """The same answer, from which only the named terms are used."""
        return self._replace(functions=())


def _answered(
    question: Question,
    keep: Path | None,
    conditions: _Conditions,
    before: _Answer | None = None,
) -> _Answer:
    """Search for terms, test the result, and return the diagnosis.

    **Arguments:** an answer `before` provides the terms, functions and values from
    which the search may start.
    """
    case, seed, report, policy, _ = conditions
    ripple = None
    if question.drives:
        report("examining the speed of the drive", None)
        ripple = ripple_of(
            question.drives, question.drive_noise, question.drive_channel, policy
        )
    trials = conditions.trials(question, keep)
    search = Search(trials)
    known, earlier = None, ()
    if before is not None:
        known = _again(trials, before.diagnosis.names, before.diagnosis.after)
        earlier = before.functions
    best = search.run()
    if known is not None and known.bic < best.bic:
        best = search.refined(known)
    sharper = with_fitted_speed(question, trials, best)
    if sharper is not None:
        question = sharper
        folder = None if keep is None else keep / "with_fitted_speed"
        trials = conditions.trials(question, folder)
        search = Search(trials)
        # known even if no time is left for the second search
        trials.attempt(best.names, best, policy.iterations)
        best = search.run()
    bare, rough = trials.known[frozenset()], None
    far = model_errors_dominate(bare.fit, best.fit, policy)
    # an odd recording is no missing physics: the diagnosis is repeated without it
    name = odd_record(best.fit, policy)
    odd = name is not None and not elsewhere(question.problem, name, policy)
    if far and not odd:
        rough = _roughly(question, bare, keep, conditions, earlier)
    if rough is not None and not rough.choice.explained(policy):
        return _Answer(diagnosis_of(case, *rough, ripple), rough.choice.functions)
    loosely = rough is not None and bool(rough.choice.functions)
    if rough is not None and loosely:
        # their fits to connected pieces may leave only noise; they began with those of
        # the answer before
        earlier = rough.choice.functions
    if rough is not None and rough.choice.named.best.names:
        # the physics was found, so that the stated noise can be used
        found = rough.choice.named.best
        again = _again(trials, found.names, found.fit)
        if again is not None and again.bic < best.bic:
            best = search.refined(again)
    choice = choose(question, trials, best, seed, not odd, earlier, loosely)
    if rough is not None and rough.finds and not choice.explained(policy):
        return _Answer(diagnosis_of(case, *rough, ripple), rough.choice.functions)
    found = diagnosis_of(case, question, trials, choice, ripple)
    return _Answer(found, choice.functions)


def _again(trials: Trials, names: Collection[str], found: Fit) -> Trial | None:
    """Fit the terms of another problem, starting from their strengths there."""
    terms = frozenset(term.name for term in trials.terms if term.name in names)
    point = starting_at(found, trials.problem)
    start = Trial(terms, dataclasses.replace(found, point=point), math.inf, 0, False)
    return trials.attempt(terms, start, trials.policy.iterations)


class _Roughly(NamedTuple):
    """A question that allows for errors of the model, with its fits and the terms
    chosen.
    """

    question: Question
    trials: Trials
    choice: Choice

    @property
    def finds(self) -> bool:
        """Whether terms or functions were found."""
        named, unnamed = self.choice.named, self.choice.unnamed
        return bool(named.best.names) or unnamed.found is not None


def _roughly(
    question: Question,
    bare: Trial,
    keep: Path | None,
    conditions: _Conditions,
    earlier: Sequence[Missing] = (),
) -> _Roughly | None:
    """Choose terms with joints and noise that allow for errors of the model.

    **Arguments:** `bare`: the fit of the textbook model to complete flights; `earlier`
    fits with functions.

    **Returns:** `None` if single pieces of flight hardly show the errors.
    """
    _, seed, report, policy, _ = conditions
    report("allowing for model errors", None)
    rough = with_model_error(question, policy)
    if rough is None:
        return None
    folder = None if keep is None else keep / "with_model_error"
    trials = conditions.trials(rough, folder)
    choice = choose(rough, trials, Search(trials).run(), seed, earlier=earlier)
    report("fitting complete flights", None)
    whole = whole_flights(bare.fit, choice.fit, rough.looseness, policy)
    return _Roughly(rough, trials, dataclasses.replace(choice, whole=whole))
